#include "solver/gltf/materials.h"

#include <algorithm>
#include <array>

namespace radbake::gltf {
namespace {

/// Full reflectance would never let light die out in a closed room.
constexpr double kMostReflectance = 0.9999;

struct Texture {
  const char* name;
  const char* reason;
};

template <std::size_t N>
std::array<double, N> Factor(const Json& object, const char* key, const std::array<double, N>& otherwise,
                             const Place& place) {
  const std::array<double, N> factor = FindNumbers<N>(object, key, place).value_or(otherwise);
  if (std::any_of(factor.begin(), factor.end(),
                  [](double value) { return value < 0 || value > kBrightest; })) {
    Fail(place, std::string(key) + " is negative or too large");
  }
  return factor;
}

void IgnoreTexture(const Json& root, const Json& object, const Texture& texture, const std::string& material,
                   const Place& place, Scene& scene) {
  const Json* info = FindObject(object, texture.name, place);
  if (info == nullptr) {
    return;
  }
  const Json* textures = Find(root, "textures");
  FindIndex(*info, "index", textures != nullptr && textures->is_array() ? textures->size() : 0, place);
  Ignore(scene, texture.name + (" of " + material), texture.reason);
  if (FindExtension(*info, "KHR_texture_transform", place) != nullptr) {
    Ignore(scene, "KHR_texture_transform of " + std::string(texture.name) + " of " + material,
           "the texture is not used");
  }
}

void ImportDiffuse(const Json& root, const Json& json, const std::string& name, const Place& place,
                   Scene& scene, Material& material) {
  static const Json kEmpty = Json::object();
  const Json* pbr = FindObject(json, "pbrMetallicRoughness", place);
  const Json& base = pbr == nullptr ? kEmpty : *pbr;
  const std::array<double, 4> color = Factor<4>(base, "baseColorFactor", {1, 1, 1, 1}, place);
  material.reflectance = Rgb(color[0], color[1], color[2]);
  if ((material.reflectance > kMostReflectance).any()) {
    material.reflectance = material.reflectance.min(kMostReflectance);
    scene.warnings.push_back("the reflectance of " + name + " is above 0.9999: taken as 0.9999");
  }
  if (Number(base, "metallicFactor", 1, place) > 0 && place.index != Place::kWhole) {
    Ignore(scene, "metallicFactor of " + name,
           "metal is taken as diffuse, with the colour of baseColorFactor");
  }
  IgnoreTexture(root, base, {"baseColorTexture", "the light that it reflects follows baseColorFactor alone"},
                name, place, scene);
  IgnoreTexture(root, base, {"metallicRoughnessTexture", "all surfaces are diffuse"}, name, place, scene);
  IgnoreTexture(root, json, {"normalTexture", "light meets the surface itself"}, name, place, scene);
  IgnoreTexture(root, json, {"occlusionTexture", "occlusion is computed"}, name, place, scene);
}

void ImportEmission(const Json& root, const Json& json, const std::string& name, const Place& place,
                    Scene& scene, Material& material) {
  constexpr const char* kStrength = "KHR_materials_emissive_strength";
  const std::array<double, 3> factor = Factor<3>(json, "emissiveFactor", {0, 0, 0}, place);
  double strength = 1;
  if (const Json* extension = FindExtension(json, kStrength, place)) {
    strength = Number(*extension, "emissiveStrength", 1, place);
    if (strength < 0 || strength > kBrightest) {
      Fail(place, "emissiveStrength is negative or too large");
    }
  }
  material.emission = Rgb(factor[0], factor[1], factor[2]) * strength;
  if ((material.emission > kBrightest).any()) {
    Fail(place, "emissiveFactor × emissiveStrength is too large");
  }
  IgnoreTexture(root, json, {"emissiveTexture", "the light that it gives follows emissiveFactor alone"}, name,
                place, scene);
}

void IgnoreExtensions(const Json& json, const std::string& name, const Place& place, Scene& scene) {
  const Json* extensions = FindObject(json, "extensions", place);
  if (extensions == nullptr) {
    return;
  }
  for (const auto& extension : extensions->items()) {
    if (extension.key() != "KHR_materials_emissive_strength" && extension.key() != "KHR_materials_unlit") {
      Ignore(scene, Quoted(extension.key()) + " of " + name, "all surfaces are diffuse");
    }
  }
}

}  // namespace

void Ignore(Scene& scene, const std::string& feature, const std::string& reason) {
  scene.ignored.push_back({feature, reason});
  scene.warnings.push_back("ignored: " + feature + ": " + reason);
}

Material ImportMaterial(const Json& root, std::optional<std::size_t> index, Scene& scene) {
  static const Json kEmpty = Json::object();
  const Json& json = index ? root.at("materials")[*index] : kEmpty;
  const Place place{index ? "material" : "default material", index.value_or(Place::kWhole)};
  Material material;
  material.name = Text(json, "name", ToString(place), place);
  const std::string name = index ? "material " + Quoted(material.name) : "the default material";
  material.sides = Flag(json, "doubleSided", false, place) ? Sides::kBoth : Sides::kFront;
  if (FindExtension(json, "KHR_materials_unlit", place) != nullptr) {
    material.role = Role::kBlocker;
    return material;
  }
  ImportDiffuse(root, json, name, place, scene, material);
  ImportEmission(root, json, name, place, scene, material);
  IgnoreExtensions(json, name, place, scene);
  if (const std::string mode = Text(json, "alphaMode", "OPAQUE", place); mode != "OPAQUE") {
    Ignore(scene, "alphaMode " + Quoted(mode) + " of " + name, "no light passes through");
  }
  return material;
}

}  // namespace radbake::gltf
