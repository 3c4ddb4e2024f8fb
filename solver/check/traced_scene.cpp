#include "solver/check/traced_scene.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace radbake {
namespace {

UnitBox Normalize(const Scene& scene) {
  Eigen::AlignedBox3d box;
  for (const Surface& surface : scene.surfaces) {
    for (const Triangle& triangle : surface.triangles) {
      for (const Index vertex : triangle) {
        box.extend(surface.positions[vertex]);
      }
    }
  }
  if (box.isEmpty() || !(box.sizes().maxCoeff() > 0)) {
    throw InputError("the scene has no surface");
  }
  return {.centre = box.center(), .scale = 1 / box.sizes().maxCoeff()};
}

}  // namespace

Vec3 PointOf(const Corners& corners, std::array<double, 2> sample) {
  const double root = std::sqrt(sample[0]);
  return (1 - root) * corners[0] + root * (1 - sample[1]) * corners[1] + root * sample[1] * corners[2];
}

TracedScene::TracedScene(const Scene& scene) : normalization(Normalize(scene)) {
  for (const Surface& surface : scene.surfaces) {
    const Material& material = scene.materials[surface.material];
    const bool diffuse = material.role == Role::kDiffuse;
    for (const Triangle& triangle : surface.triangles) {
      const Corners& placed = corners.emplace_back(Corners{normalization(surface.positions[triangle[0]]),
                                                           normalization(surface.positions[triangle[1]]),
                                                           normalization(surface.positions[triangle[2]])});
      const Vec3 cross = (placed[1] - placed[0]).cross(placed[2] - placed[0]);
      Facet facet;
      if (const double norm = cross.norm(); norm > 0) {
        facet.normal = cross / norm;
        facet.area = norm / 2;
        facet.front = diffuse;
        facet.back = diffuse && material.sides == Sides::kBoth;
      }
      if (diffuse) {
        facet.emission = material.emission;
        facet.reflectance = material.reflectance;
        brightest = std::max(brightest, facet.area > 0 ? material.emission.maxCoeff() : 0);
      }
      facets.push_back(facet);
    }
  }
  environment = scene.environment;
  brightest = std::max(brightest, environment.maxCoeff());
  for (PunctualLight light : scene.lights) {
    light.position = normalization(light.position);
    light.range *= normalization.scale;
    if (light.kind != PunctualLight::Kind::kDirectional) {
      light.intensity *= normalization.scale * normalization.scale;
    }
    brightest = std::max(brightest, light.intensity.maxCoeff() / std::numbers::pi);
    lights.push_back(light);
  }
  if (brightest > 0) {
    for (Facet& facet : facets) {
      facet.emission /= brightest;
    }
    for (PunctualLight& light : lights) {
      light.intensity /= brightest;
    }
    environment /= brightest;
  }
}

}  // namespace radbake
