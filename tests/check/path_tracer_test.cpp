#include "solver/check/path_tracer.h"

#include <gtest/gtest.h>

#include <numbers>

#include "solver/check/probes.h"
#include "tests/check/measure_test.h"

namespace radbake {
namespace {

class PathTracerInAFurnace : public testing::TestWithParam<double> {};

TEST_P(PathTracerInAFurnace, FindsTheClosedForm) {
  const double reflectance = GetParam();
  const TracedScene traced(Furnace(reflectance, 3.0, 7.0));
  const PathTracer tracer(traced);
  double sum = 0;
  const std::vector<Place> probes = DrawProbes(traced, 24, 1);
  for (std::size_t i = 0; i < probes.size(); ++i) {
    const Measured measured = Measure(traced, tracer, probes[i], i);
    ExpectMeasured(measured, FurnaceIrradiance(reflectance, 3.0));
    sum += measured.irradiance;
  }
  const double mean = sum / static_cast<double>(probes.size());
  EXPECT_NEAR(mean / FurnaceIrradiance(reflectance, 3.0), 1, 0.005);
}

INSTANTIATE_TEST_SUITE_P(Reflectances, PathTracerInAFurnace, testing::Values(0.0, 0.5, 0.9));

TEST(PathTracer, BearsWallsThatReflectNearlyEverything) {
  ExpectMeasured(Measure(Furnace(0.99, 1), {0.3, 0.4, 0}, Vec3::UnitZ()), FurnaceIrradiance(0.99, 1));
}

TEST(PathTracer, KeepsTheChannelsApart) {
  Scene scene = Furnace(0.5, 1);
  scene.materials[0].reflectance = {0.8, 0.5, 0};
  scene.materials[0].emission = {0, 2, 1};
  const TracedScene traced(scene);
  const Rgb e = PathTracer(traced).Irradiance(DrawProbes(traced, 1, 1)[0], 4096, 1).irradiance;
  EXPECT_EQ(e[0], 0);
  EXPECT_NEAR(e[1] * traced.brightest, 4, 0.1);
  EXPECT_NEAR(e[2] * traced.brightest, 1, 0.02);
}

TEST(PathTracer, FindsTheIrradianceUnderARectangularLamp) {
  for (const double height : {0.01, 0.5, 20.0}) {
    Scene scene;
    AddQuad(scene, AddMaterial(scene, 0, 5), {-1, -0.5, height}, 1.5 * Vec3::UnitY(), 3 * Vec3::UnitX());
    AddQuad(scene, AddMaterial(scene, 0.7, 0), {-5, -5, 0}, 10 * Vec3::UnitX(), 10 * Vec3::UnitY());
    const double expected =
        5 * (UnderCornerOfRectangle(1, 0.5, height) + UnderCornerOfRectangle(1, 1, height) +
             UnderCornerOfRectangle(2, 0.5, height) + UnderCornerOfRectangle(2, 1, height));
    ExpectMeasured(Measure(scene, Vec3::Zero(), Vec3::UnitZ()), expected);
  }
}

TEST(PathTracer, FindsTheBrightestOfLampsThatOverlapInOnePlane) {
  for (const bool small_first : {true, false}) {
    Scene scene;
    const auto add = [&](double half, double emission) {
      AddQuad(scene, AddMaterial(scene, 0, emission), {-half, -half, 1}, 2 * half * Vec3::UnitY(),
              2 * half * Vec3::UnitX());
    };
    add(small_first ? 0.25 : 1, small_first ? 50 : 5);
    add(small_first ? 1 : 0.25, small_first ? 5 : 50);
    AddQuad(scene, AddMaterial(scene, 0.7, 0), {-5, -5, 0}, 10 * Vec3::UnitX(), 10 * Vec3::UnitY());
    const double large = 4 * UnderCornerOfRectangle(1, 1, 1);
    const double small = 4 * UnderCornerOfRectangle(0.25, 0.25, 1);
    ExpectMeasured(Measure(scene, Vec3::Zero(), Vec3::UnitZ()), 5 * (large - small) + 50 * small);
  }
}

TEST(PathTracer, FindsTheFormFactorOfParallelSquares) {
  Scene scene;
  AddQuad(scene, AddMaterial(scene, 0.5, 0), Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY());
  AddQuad(scene, AddMaterial(scene, 0, 1), Vec3::UnitZ(), Vec3::UnitY(), Vec3::UnitX());
  const TracedScene traced(scene);
  const PathTracer tracer(traced);
  double sum = 0;
  std::size_t count = 0;
  for (const Place& place : DrawProbes(traced, 2048, 1)) {
    if (place.normal.z() > 0) {
      sum += tracer.Irradiance(place, 16, ++count).irradiance[0];
    }
  }
  EXPECT_EQ(count, 1024);
  EXPECT_NEAR(sum / static_cast<double>(count), 0.199825, 0.0008);
}

TEST(PathTracer, GivesNoLightFromTheBackOfASingleSidedLamp) {
  Scene scene;
  AddQuad(scene, AddMaterial(scene, 0.5, 5), {-1, -1, 1}, 2 * Vec3::UnitX(), 2 * Vec3::UnitY());
  EXPECT_EQ(Measure(scene, Vec3::Zero(), Vec3::UnitZ()).irradiance, 0);
}

TEST(PathTracer, GivesLightFromBothSidesOfADoubleSidedLamp) {
  Scene scene;
  AddQuad(scene, AddMaterial(scene, 0.5, 5, Sides::kBoth), {-1, -1, 1}, 2 * Vec3::UnitX(), 2 * Vec3::UnitY());
  const double expected = 5 * 4 * UnderCornerOfRectangle(1, 1, 1);
  ExpectMeasured(Measure(scene, Vec3::Zero(), Vec3::UnitZ()), expected);
  ExpectMeasured(Measure(scene, {0, 0, 2}, -Vec3::UnitZ()), expected);
}

// A lamp shines down onto a white sheet; the point sees the sheet's other side, or the lit one.
TEST(PathTracer, ReflectsFromTheSidesThatTheMaterialHas) {
  const auto measure = [](Sides sides, bool lit_side) {
    Scene scene;
    AddQuad(scene, AddMaterial(scene, 0, 5), {-1, -1, 2}, 2 * Vec3::UnitY(), 2 * Vec3::UnitX());
    // Faces away from the lamp.
    AddQuad(scene, AddMaterial(scene, 0.5, 0, sides), {-1, -1, 0}, 2 * Vec3::UnitY(), 2 * Vec3::UnitX());
    return Measure(scene, {0, 0, lit_side ? 1.0 : -1.0}, {0, 0, lit_side ? -1.0 : 1.0}).irradiance;
  };
  EXPECT_EQ(measure(Sides::kFront, true), 0);
  EXPECT_EQ(measure(Sides::kFront, false), 0);
  EXPECT_GT(measure(Sides::kBoth, true), 0.1);
  EXPECT_EQ(measure(Sides::kBoth, false), 0);
}

TEST(PathTracer, IsBlockedByBacksAndBlockers) {
  const auto measure = [](Sides sides, Role role, bool turned) {
    Scene scene;
    AddQuad(scene, AddMaterial(scene, 0, 5), {-1, -1, 2}, 2 * Vec3::UnitY(), 2 * Vec3::UnitX());
    const Index screen = AddMaterial(scene, 0.9, role == Role::kBlocker ? 7 : 0, sides, role);
    const Vec3 x = 8 * Vec3::UnitX();
    const Vec3 y = 8 * Vec3::UnitY();
    AddQuad(scene, screen, {-4, -4, 1}, turned ? y : x, turned ? x : y);
    return Measure(scene, Vec3::Zero(), Vec3::UnitZ()).irradiance;
  };
  EXPECT_EQ(measure(Sides::kFront, Role::kDiffuse, false), 0);
  EXPECT_EQ(measure(Sides::kFront, Role::kDiffuse, true), 0);
  EXPECT_EQ(measure(Sides::kBoth, Role::kBlocker, false), 0);
  EXPECT_EQ(measure(Sides::kBoth, Role::kBlocker, true), 0);
}

TEST(PathTracer, FindsHalfTheLightBehindAScreen) {
  // The screen's edge is in the plane through the point that halves the lamp.
  Scene scene;
  AddQuad(scene, AddMaterial(scene, 0, 5), {-1, -1, 1}, 2 * Vec3::UnitY(), 2 * Vec3::UnitX());
  AddQuad(scene, AddMaterial(scene, 0, 0, Sides::kFront, Role::kBlocker), {0, -3, 0.5}, 3 * Vec3::UnitX(),
          6 * Vec3::UnitY());
  ExpectMeasured(Measure(scene, Vec3::Zero(), Vec3::UnitZ()), 5 * 2 * UnderCornerOfRectangle(1, 1, 1));
}

TEST(PathTracer, CountsAShadowRayAndAPathRayAVertex) {
  Scene scene;
  AddQuad(scene, AddMaterial(scene, 0, 5), {-1, -1, 1}, 2 * Vec3::UnitY(), 2 * Vec3::UnitX());
  const TracedScene traced(scene);
  const Place below{.point = traced.normalization(Vec3::Zero()), .normal = Vec3::UnitZ()};
  EXPECT_EQ(PathTracer(traced).Irradiance(below, 10, 1).rays, 20);
}

}  // namespace
}  // namespace radbake
