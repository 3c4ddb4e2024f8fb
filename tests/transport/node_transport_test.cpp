#include "solver/transport/node_transport.h"

#include <gtest/gtest.h>

#include <numbers>

#include "solver/transport/form_factor.h"
#include "solver/transport/punctual.h"
#include "solver/transport/seen_polygon.h"
#include "tests/test_scenes.h"

namespace radbake {
namespace {

/// Two small balls of 80 triangles, fronts outwards, far apart in a large box that closes the scene.
struct TwoBalls {
  TwoBalls() : patches(CutIntoPatches(Make())), hierarchy(patches, true), visibility(patches) {}

  static Scene Make() {
    Scene scene = testing::FurnaceSphere(0.5, 1);
    Surface& first = scene.surfaces[0];
    for (Triangle& t : first.triangles) {
      std::swap(t[1], t[2]);
    }
    first.normals.clear();
    Surface second = first;
    for (Vec3& p : second.positions) {
      p += Vec3(10, 0, 0);
    }
    scene.surfaces.push_back(second);
    testing::AddBox(scene, 0, Vec3(-20, -20, -20), Vec3(30, 20, 20), true);
    return scene;
  }

  /// The cluster that holds exactly the triangles of a ball.
  Index Ball(double x) const {
    for (Index c = 0; c < hierarchy.clusters().size(); ++c) {
      const Cluster& cluster = hierarchy.clusters()[c];
      const Vec3 centre = patches.normalization.ToNormalized(Vec3(x, 0, 0));
      if (cluster.patches_end - cluster.patches_begin == 80 && (cluster.centre - centre).norm() < 1e-3) {
        return ClusterNode(c);
      }
    }
    return kNone;
  }

  Patches patches;
  Hierarchy hierarchy;
  Visibility visibility;
};

TEST(NodeTransport, BetweenClustersIsTheSumOverTheirPatches) {
  const TwoBalls scene;
  const Index left = scene.Ball(0);
  const Index right = scene.Ball(10);
  ASSERT_NE(left, kNone);
  ASSERT_NE(right, kNone);
  double exchange = 0;
  for (Index i = 0; i < 80; ++i) {
    for (Index j = 80; j < 160; ++j) {
      exchange += ExchangeArea(scene.hierarchy.Shape(i), scene.hierarchy.Shape(j));
    }
  }
  constexpr int kRays = 1 << 16;
  const NodeTransport found = BetweenNodes(scene.hierarchy, scene.visibility, left, right, 1, kRays);
  EXPECT_NEAR(found.form_factor * scene.hierarchy.Area(left) / exchange, 1, 0.02);
  EXPECT_GT(found.variation, 0);
  // Convex bodies: what faces is in sight.
  EXPECT_NEAR(found.visibility, 1, 1e-6);
  const NodeTransport itself = BetweenNodes(scene.hierarchy, scene.visibility, left, left, 1, kRays);
  EXPECT_NEAR(itself.form_factor, 0, 1e-6);
}

TEST(NodeTransport, SeesAClusterFromAPointAsTheSumOfItsPatches) {
  const TwoBalls scene;
  const Index ball = scene.Ball(10);
  const Vec3 x = scene.patches.normalization.ToNormalized(Vec3(2, 1, 0));
  const Vec3 n = Vec3(1, 0.5, 0).normalized();
  double exact = 0;
  for (Index j = 80; j < 160; ++j) {
    exact += PointToPolygon(x, n, scene.hierarchy.Shape(j));
  }
  QuasiRandom<3> random(1);
  Light light;
  light.Extend(scene.hierarchy);
  light.radiosity.assign(scene.hierarchy.size(), Rgb(1, 0, 0));
  for (Index j = 80; j < 120; ++j) {
    light.radiosity[j] = Rgb(1, 1, 0);
  }
  double part = 0;
  for (Index j = 80; j < 120; ++j) {
    part += PointToPolygon(x, n, scene.hierarchy.Shape(j));
  }
  const Rgb seen = FromNodeAt(scene.hierarchy, light, scene.visibility, x, n, ball, random, 1 << 14);
  EXPECT_NEAR(seen[0] / exact, 1, 0.01);
  EXPECT_NEAR(seen[1] / part, 1, 0.02);
  EXPECT_EQ(seen[2], 0);
  EXPECT_NEAR(UnoccludedAt(scene.hierarchy, x, n, ball) / exact, 1, 0.05);
}

TEST(NodeTransport, ProvesWhatLiesBehindAnElement) {
  Scene scene;
  const Index white = testing::AddMaterial(scene, 0.5, 1);
  testing::AddQuad(scene, white, Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(1, 1, 0), Vec3(0, 1, 0));  // faces +z
  for (int k = 0; k < 8; ++k) {
    testing::AddQuad(scene, white, Vec3(0.1 * k, 0, -1), Vec3(0.1 * k + 0.1, 0, -1),
                     Vec3(0.1 * k + 0.1, 0.1, -1), Vec3(0.1 * k, 0.1, -1));
  }
  const Patches patches = CutIntoPatches(scene);
  const Hierarchy hierarchy(patches, true);
  const Visibility visibility(patches);
  const Index below = ClusterNode(hierarchy.clusters().Above(1));
  const NodeTransport found = BetweenNodes(hierarchy, visibility, 0, below, 1, 32);
  EXPECT_EQ(found.form_factor, 0);
  EXPECT_EQ(found.variation, 0);
}

TEST(Punctual, KernelIsTheCosineOverTheSquareOfTheDistance) {
  PunctualLight point;
  point.position = Vec3(0, 0, 2);
  EXPECT_DOUBLE_EQ(PunctualKernel(point, Vec3(0, 0, 0), Vec3::UnitZ()), 0.25);
  EXPECT_NEAR(PunctualKernel(point, Vec3(2, 0, 0), Vec3::UnitZ()), std::sqrt(0.5) / 8, 1e-15);
  EXPECT_EQ(PunctualKernel(point, Vec3(0, 0, 0), -Vec3::UnitZ()), 0);
  PunctualLight sun;
  sun.kind = PunctualLight::Kind::kDirectional;
  sun.direction = Vec3(1, 0, -1).normalized();
  EXPECT_NEAR(PunctualKernel(sun, Vec3(5, 6, 7), Vec3::UnitZ()), std::sqrt(0.5), 1e-15);
  EXPECT_EQ(PunctualKernel(sun, Vec3(5, 6, 7), -Vec3::UnitZ()), 0);
}

TEST(Punctual, LinksWithNothingBetweenNeedNoRay) {
  Scene scene = testing::ShadowRoom();
  PunctualLight point;
  point.position = Vec3(1, 1.5, 1);
  point.intensity = Rgb::Constant(1);
  scene.lights.push_back(point);
  const Patches patches = CutIntoPatches(scene);
  const Visibility visibility(patches);
  const PunctualLight& light = patches.lights[0];
  // The ceiling is open to the light but for the lamp; the slab (0.6 to 1.2 wide, 0.8 high) shades the floor.
  const Hierarchy hierarchy(patches);
  EXPECT_FALSE(ClearToLight(visibility, hierarchy.Shape(0), light));
  EXPECT_TRUE(ClearToLight(visibility, hierarchy.Shape(4), light));
}

}  // namespace
}  // namespace radbake
