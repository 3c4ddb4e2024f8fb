#include "solver/check/probes.h"

#include <gtest/gtest.h>

#include "tests/check/check_scenes_test.h"

namespace radbake {
namespace {

TEST(Probes, AreDrawnByArea) {
  Scene scene;
  const Index material = AddMaterial(scene, 0.5, 1);
  AddQuad(scene, material, Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY());
  AddQuad(scene, material, {0, 0, 2}, Vec3::UnitX(), 3 * Vec3::UnitY());
  int upper = 0;
  double x = 0;
  double y = 0;
  const TracedScene traced(scene);
  for (const Place& place : DrawProbes(traced, 1000, 7)) {
    const Vec3 world = place.point / traced.normalization.scale + traced.normalization.centre;
    upper += world.z() > 1 ? 1 : 0;
    x += world.x() / 1000;
    y += world.y() / 1000;
    EXPECT_EQ(place.normal, Vec3::UnitZ());
  }
  EXPECT_EQ(upper, 750);
  EXPECT_NEAR(x, 0.5, 0.005);
  EXPECT_NEAR(y, 0.25 * 0.5 + 0.75 * 1.5, 0.01);
}

TEST(Probes, LieOnBothSidesOfADoubleSidedSurface) {
  Scene scene;
  AddQuad(scene, AddMaterial(scene, 0.5, 1, Sides::kBoth), Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY());
  int above = 0;
  for (const Place& place : DrawProbes(TracedScene(scene), 100, 7)) {
    above += place.normal == Vec3::UnitZ() ? 1 : 0;
  }
  EXPECT_EQ(above, 50);
}

TEST(Probes, AvoidBlockersAndTrianglesWithoutArea) {
  Scene scene;
  AddQuad(scene, AddMaterial(scene, 0.5, 1, Sides::kBoth, Role::kBlocker), Vec3::Zero(), Vec3::UnitX(),
          Vec3::UnitY());
  AddQuad(scene, AddMaterial(scene, 0.5, 1), {0, 0, 1}, Vec3::UnitX(), Vec3::UnitX());
  EXPECT_THROW(DrawProbes(TracedScene(scene), 1, 7), InputError);
  AddQuad(scene, AddMaterial(scene, 0.5, 1), {0, 0, 2}, Vec3::UnitX(), Vec3::UnitY());
  for (const Place& place : DrawProbes(TracedScene(scene), 100, 7)) {
    ASSERT_NEAR(place.point.z(), 0.5, 1e-15);  // of -0.5 to 0.5
  }
}

TEST(Probes, DifferFromSeedToSeed) {
  const TracedScene traced(Furnace(0.5, 1));
  EXPECT_NE(DrawProbes(traced, 1, 1)[0].point, DrawProbes(traced, 1, 2)[0].point);
}

}  // namespace
}  // namespace radbake
