#include "solver/check/bake_lookup.h"

#include <gtest/gtest.h>

#include "solver/check/probes.h"
#include "tests/check/check_scenes_test.h"

namespace radbake {
namespace {

Rgb Linear(const Vec3& p) {
  return {1 + p.x(), 2 + p.y() - p.z(), 3 * p.z()};
}

// A room's bake, each quad divided into n by n, irradiance linear in the world.
BakedTriangles LinearBake(const Scene& scene, int n, const Vec3& shift = Vec3::Zero()) {
  BakedTriangles baked;
  for (const Surface& surface : scene.surfaces) {
    const Vec3 u = (surface.positions[1] - surface.positions[0]) / n;
    const Vec3 v = (surface.positions[3] - surface.positions[0]) / n;
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) {
        const auto first = static_cast<Index>(baked.positions.size());
        for (const auto& [s, t] : {std::pair{i, j}, {i + 1, j}, {i + 1, j + 1}, {i, j + 1}}) {
          const Vec3 position = surface.positions[0] + s * u + t * v;
          baked.positions.emplace_back((position + shift).cast<float>().cast<double>());
          baked.irradiance.push_back(Linear(position));
        }
        baked.triangles.push_back({first, first + 1, first + 2});
        baked.triangles.push_back({first, first + 2, first + 3});
      }
    }
  }
  return baked;
}

void ExpectLinear(const Scene& scene, const BakedTriangles& baked, double tolerance) {
  const TracedScene traced(scene);
  const std::vector<Place> probes = DrawProbes(traced, 500, 3);
  const auto found = LookUp(baked, traced.normalization, probes);
  for (std::size_t i = 0; i < probes.size(); ++i) {
    ASSERT_TRUE(found[i]);
    const Rgb expected = Linear(probes[i].point / traced.normalization.scale + Vec3::Constant(0.5));
    EXPECT_LT((*found[i] - expected).abs().maxCoeff(), tolerance);
  }
}

TEST(BakeLookup, InterpolatesLinearly) {
  const Scene scene = Furnace(0.5, 1);
  for (const int n : {1, 7}) {
    ExpectLinear(scene, LinearBake(scene, n), 1e-6);
  }
}

TEST(BakeLookup, BearsRoundingFarFromTheOrigin) {
  Scene scene = Furnace(0.5, 1);
  const Vec3 far(300.1, -200.3, 100.7);
  const BakedTriangles baked = LinearBake(scene, 5, far);
  for (Surface& surface : scene.surfaces) {
    for (Vec3& position : surface.positions) {
      position += far;
    }
  }
  ExpectLinear(scene, baked, 2e-4);
}

TEST(BakeLookup, TakesTheSideThatFacesTheSameWay) {
  Scene scene;
  AddQuad(scene, AddMaterial(scene, 0.5, 1, Sides::kBoth), Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY());
  BakedTriangles baked = UniformBake(scene, 2);
  const std::size_t vertices = baked.positions.size();
  baked.positions.reserve(2 * vertices);
  for (std::size_t i = 0; i < vertices; ++i) {
    baked.positions.push_back(baked.positions[i]);
    baked.irradiance.emplace_back(Rgb::Constant(9));
  }
  const auto shift = static_cast<Index>(vertices);
  baked.triangles.push_back({shift, shift + 2, shift + 1});
  baked.triangles.push_back({shift, shift + 3, shift + 2});
  const TracedScene traced(scene);
  const std::vector<Place> probes = DrawProbes(traced, 20, 3);
  const auto found = LookUp(baked, traced.normalization, probes);
  for (std::size_t i = 0; i < probes.size(); ++i) {
    ASSERT_TRUE(found[i]);
    EXPECT_NEAR((*found[i])[0], probes[i].normal.z() > 0 ? 2 : 9, 1e-12);
  }
}

TEST(BakeLookup, TakesTheNearerOfTwoSheets) {
  Scene scene;
  const Index material = AddMaterial(scene, 0.5, 1);
  AddQuad(scene, material, Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY());
  AddQuad(scene, material, {0, 0, 1e-6}, Vec3::UnitX(), Vec3::UnitY());
  BakedTriangles baked = UniformBake(scene, 2);
  for (std::size_t i = 4; i < 8; ++i) {
    baked.irradiance[i] = Rgb::Constant(9);
  }
  const TracedScene traced(scene);
  const std::vector<Place> probes = DrawProbes(traced, 20, 3);
  const auto found = LookUp(baked, traced.normalization, probes);
  for (std::size_t i = 0; i < probes.size(); ++i) {
    ASSERT_TRUE(found[i]);
    EXPECT_NEAR((*found[i])[0], probes[i].point.z() < 0 ? 2 : 9, 1e-12);
  }
}

TEST(BakeLookup, FindsNothingWhereTheBakeHasNoSurface) {
  const Scene scene = Furnace(0.5, 1);
  const BakedTriangles baked = UniformBake(scene, 1, 0);
  const TracedScene traced(scene);
  const std::vector<Place> probes = DrawProbes(traced, 600, 3);
  const auto found = LookUp(baked, traced.normalization, probes);
  for (std::size_t i = 0; i < probes.size(); ++i) {
    EXPECT_EQ(found[i].has_value(), probes[i].normal.z() <= 0);
  }
}

}  // namespace
}  // namespace radbake
