/// Small scenes with known answers for the checker's tests.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>
#include <utility>
#include <vector>

#include "solver/bake/baked_scene.h"
#include "solver/check/sample_points.h"
#include "solver/scene/scene.h"

namespace radbake {

inline Index AddMaterial(Scene& scene, double reflectance, double emission, Sides sides = Sides::kFront,
                         Role role = Role::kDiffuse) {
  Material material;
  material.reflectance = Rgb::Constant(reflectance);
  material.emission = Rgb::Constant(emission);
  material.sides = sides;
  material.role = role;
  scene.materials.push_back(material);
  return static_cast<Index>(scene.materials.size() - 1);
}

/// A parallelogram that faces along u × v.
inline void AddQuad(Scene& scene, Index material, const Vec3& corner, const Vec3& u, const Vec3& v) {
  Surface surface;
  surface.material = material;
  surface.positions = {corner, corner + u, corner + u + v, corner + v};
  surface.triangles = {{0, 1, 2}, {0, 2, 3}};
  scene.surfaces.push_back(std::move(surface));
}

/// A closed box, its fronts inside.
inline void AddRoom(Scene& scene, Index material, const Vec3& lowest, const Vec3& extents) {
  const Vec3 x = extents.x() * Vec3::UnitX();
  const Vec3 y = extents.y() * Vec3::UnitY();
  const Vec3 z = extents.z() * Vec3::UnitZ();
  AddQuad(scene, material, lowest, x, y);
  AddQuad(scene, material, lowest + z, y, x);
  AddQuad(scene, material, lowest, y, z);
  AddQuad(scene, material, lowest + x, z, y);
  AddQuad(scene, material, lowest, z, x);
  AddQuad(scene, material, lowest + y, x, z);
}

/// Everywhere E = π·emission / (1 − reflectance).
inline Scene Furnace(double reflectance, double emission, double size = 1) {
  Scene scene;
  AddRoom(scene, AddMaterial(scene, reflectance, emission), Vec3::Zero(), Vec3::Constant(size));
  return scene;
}
inline double FurnaceIrradiance(double reflectance, double emission) {
  return std::numbers::pi * emission / (1 - reflectance);
}

/// Irradiance per radiance below a corner of a parallel rectangle, `a` by `b` at the distance `h`, that faces
/// the point. Lambert's formula.
inline double UnderCornerOfRectangle(double a, double b, double h) {
  const double p = std::hypot(a, h);
  const double q = std::hypot(b, h);
  return (a / p * std::atan(b / p) + b / q * std::atan(a / q)) / 2;
}

/// A bake of the scene's diffuse fronts with the same irradiance everywhere, the surface `without` left out.
inline BakedTriangles UniformBake(const Scene& scene, double irradiance, std::size_t without = SIZE_MAX) {
  BakedTriangles baked;
  for (std::size_t i = 0; i < scene.surfaces.size(); ++i) {
    const Surface& surface = scene.surfaces[i];
    if (i == without || scene.materials[surface.material].role == Role::kBlocker) {
      continue;
    }
    const auto first = static_cast<Index>(baked.positions.size());
    baked.positions.insert(baked.positions.end(), surface.positions.begin(), surface.positions.end());
    for (const Triangle& triangle : surface.triangles) {
      baked.triangles.push_back({first + triangle[0], first + triangle[1], first + triangle[2]});
    }
  }
  baked.irradiance.assign(baked.positions.size(), Rgb::Constant(irradiance));
  return baked;
}

/// Uniform in [0, 1), one for each number.
inline double RandomNumber(std::uint64_t number) {
  return static_cast<double>(Scramble(number) >> 11U) * 0x1p-53;
}

}  // namespace radbake
