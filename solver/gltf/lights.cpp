#include "solver/gltf/lights.h"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "solver/gltf/features.h"
#include "solver/gltf/import.h"
#include "solver/gltf/materials.h"
#include "solver/gltf/nodes.h"

namespace radbake::gltf {
namespace {

constexpr const char* kExtension = "KHR_lights_punctual";

PunctualLight::Kind ReadKind(const Json& json, const Place& place) {
  const std::string type = Text(json, "type", "", place);
  if (type == "point") {
    return PunctualLight::Kind::kPoint;
  }
  if (type == "spot") {
    return PunctualLight::Kind::kSpot;
  }
  if (type == "directional") {
    return PunctualLight::Kind::kDirectional;
  }
  Fail(place, "type is neither point, spot nor directional");
}

Rgb ReadIntensity(const Json& json, const Place& place) {
  const std::array<double, 3> color =
      FindNumbers<3>(json, "color", place).value_or(std::array{1.0, 1.0, 1.0});
  const double intensity = Number(json, "intensity", 1, place);
  const auto is_taken = [](double value) { return value >= 0 && value <= kBrightest; };
  for (const double channel : color) {
    if (!is_taken(channel) || !is_taken(intensity) || !is_taken(channel * intensity)) {
      Fail(place, "color or intensity is negative or too large");
    }
  }
  return Rgb(color[0], color[1], color[2]) * intensity;
}

void ReadCones(const Json& json, const Place& place, PunctualLight& light) {
  static const Json kEmpty = Json::object();
  const Json* given = FindObject(json, "spot", place);
  const Json& spot = given == nullptr ? kEmpty : *given;
  // A right angle rounded to single precision is more than one.
  constexpr double kWidest = std::numbers::pi / 2 + 1e-6;
  const double outer = Number(spot, "outerConeAngle", std::numbers::pi / 4, place);
  const double inner = Number(spot, "innerConeAngle", 0, place);
  if (outer <= 0 || outer > kWidest) {
    Fail(place, "outerConeAngle is not an angle above 0 up to π/2");
  }
  // The extension wants it smaller, but exporters write two equal ones for a cone with a sharp edge.
  if (inner < 0 || inner > outer) {
    Fail(place, "innerConeAngle is not an angle from 0 to outerConeAngle");
  }
  light.inner_cosine = std::cos(inner);
  light.outer_cosine = std::cos(outer);
}

PunctualLight ReadLight(const Json& json, const Place& place) {
  PunctualLight light;
  light.kind = ReadKind(json, place);
  light.intensity = ReadIntensity(json, place);
  if (Find(json, "range") != nullptr) {
    const double range = Number(json, "range", 0, place);
    if (!(range > 0)) {
      Fail(place, "range is not above 0");
    }
    if (light.kind != PunctualLight::Kind::kDirectional) {
      light.range = range;
    }
  }
  if (light.kind == PunctualLight::Kind::kSpot) {
    ReadCones(json, place, light);
  }
  return light;
}

}  // namespace

void ImportLights(const Json& root, const Layout& layout, Scene& scene) {
  static const Json kEmpty = Json::object();
  const Json* extension = FindExtension(root, kExtension, {"glTF"});
  const Json& lights = Objects(extension == nullptr ? kEmpty : *extension, "lights", {kExtension});
  std::vector<PunctualLight> read;
  std::vector<std::string> names;
  for (std::size_t i = 0; i < lights.size(); ++i) {
    const Place place{"light", i};
    read.push_back(ReadLight(lights[i], place));
    names.push_back("light " + (lights[i].contains("name") ? Quoted(Text(lights[i], "name", "", place))
                                                           : std::to_string(i)));
  }
  std::vector<std::optional<std::size_t>> used(layout.nodes.size());
  for (std::size_t node = 0; node < layout.nodes.size(); ++node) {
    const Place place{"node", node};
    if (const Json* use = FindExtension(root.at("nodes")[node], kExtension, place)) {
      used[node] = FindIndex(*use, "light", lights.size(), place);
    }
  }
  for (const Placed& placed : PlaceNodes(layout)) {
    const std::optional<std::size_t> index = used[placed.node];
    if (!index || !(read[*index].intensity > 0).any()) {
      continue;
    }
    PunctualLight light = read[*index];
    light.name = NameOf(root, "nodes", placed.node) + " " + names[*index];
    light.position = ToWorld(placed.world, Eigen::Vector3f::Zero(), placed.node);
    if (light.kind != PunctualLight::Kind::kPoint) {
      light.direction = -placed.world.block<3, 1>(0, 2);
      if (!(light.direction.stableNorm() > 0)) {
        Ignore(scene, light.name, "the scale of its node leaves it no direction");
        continue;
      }
      light.direction.stableNormalize();
    }
    scene.lights.push_back(light);
  }
}

}  // namespace radbake::gltf
