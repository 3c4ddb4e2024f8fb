// The path tracer against closed forms: lights without area, the sky, and many lamps.
#include <gtest/gtest.h>

#include <numbers>

#include "solver/check/probes.h"
#include "tests/check/measure_test.h"

namespace radbake {
namespace {

using std::numbers::pi;

/// A black floor of 10 × 10 m around the origin, looking up.
Scene Floor(double reflectance = 0) {
  Scene scene;
  AddQuad(scene, AddMaterial(scene, reflectance, 0), {-5, -5, 0}, 10 * Vec3::UnitX(), 10 * Vec3::UnitY());
  return scene;
}

PunctualLight Lamp(PunctualLight::Kind kind, const Vec3& position, const Vec3& direction, double intensity) {
  PunctualLight light;
  light.kind = kind;
  light.position = position;
  light.direction = direction.normalized();
  light.intensity = Rgb::Constant(intensity);
  return light;
}

double FloorIrradiance(const Scene& scene, double x, double y) {
  return Measure(scene, {x, y, 0}, Vec3::UnitZ()).irradiance;
}

TEST(PathTracerLights, APointLightFollowsTheInverseSquare) {
  Scene scene = Floor();
  scene.lights = {Lamp(PunctualLight::Kind::kPoint, {0, 0, 2}, -Vec3::UnitZ(), 40)};
  for (const double x : {0.0, 1.0, 4.0}) {
    const double d = std::hypot(x, 2);
    EXPECT_NEAR(FloorIrradiance(scene, x, 0), 40 * 2 / (d * d * d), 1e-9);
  }
  EXPECT_EQ(Measure(scene, Vec3::Zero(), -Vec3::UnitZ()).irradiance, 0);
}

TEST(PathTracerLights, ARangeEndsThem) {
  Scene scene = Floor();
  scene.lights = {Lamp(PunctualLight::Kind::kPoint, {0, 0, 2}, -Vec3::UnitZ(), 40)};
  scene.lights[0].range = 4;
  EXPECT_NEAR(FloorIrradiance(scene, 0, 0), 10 * (1 - 1.0 / 16), 1e-9);
  EXPECT_EQ(FloorIrradiance(scene, 4, 0), 0);
}

TEST(PathTracerLights, ASpotHasFullLightInsideAndNoneOutside) {
  Scene scene = Floor();
  scene.lights = {Lamp(PunctualLight::Kind::kSpot, {0, 0, 1}, -Vec3::UnitZ(), 40)};
  scene.lights[0].inner_cosine = std::cos(pi / 6);
  scene.lights[0].outer_cosine = std::cos(pi / 3);
  const auto at = [&](double angle) { return FloorIrradiance(scene, std::tan(angle), 0); };
  const auto bare = [&](double angle) { return 40 * std::pow(std::cos(angle), 3); };
  for (const double angle : {0.0, 0.2, 0.5}) {
    EXPECT_NEAR(at(angle), bare(angle), 1e-9);
  }
  const double fall = (std::cos(pi / 4) - std::cos(pi / 3)) / (std::cos(pi / 6) - std::cos(pi / 3));
  EXPECT_NEAR(at(pi / 4), bare(pi / 4) * fall * fall, 1e-9);
  EXPECT_EQ(at(1.1), 0);
}

TEST(PathTracerLights, ADirectionalLightIsTheSameEverywhereButBehindABlocker) {
  Scene scene = Floor();
  scene.lights = {Lamp(PunctualLight::Kind::kDirectional, Vec3::Zero(), {1, 0, -1}, 1000)};
  // Throws its shadow 1 m to +x.
  AddQuad(scene, AddMaterial(scene, 0, 0, Sides::kFront, Role::kBlocker), {-1, -1, 1}, 2 * Vec3::UnitX(),
          2 * Vec3::UnitY());
  const double lit = 1000 * std::sqrt(0.5);
  EXPECT_NEAR(FloorIrradiance(scene, -3, 0), lit, 1e-9);
  EXPECT_NEAR(FloorIrradiance(scene, -0.1, 0), lit, 1e-9);
  EXPECT_EQ(FloorIrradiance(scene, 0.1, 0), 0);
  EXPECT_EQ(FloorIrradiance(scene, 1.9, 0), 0);
  EXPECT_NEAR(FloorIrradiance(scene, 2.1, 0), lit, 1e-9);
}

TEST(PathTracerLights, ThreeSunsAddUp) {
  Scene scene = Floor();
  const Vec3 down = -Vec3::UnitZ();
  for (const double lux : {1.0, 20.0, 300.0}) {
    scene.lights.push_back(Lamp(PunctualLight::Kind::kDirectional, Vec3::Zero(), down, lux));
  }
  ExpectMeasured(Measure(scene, Vec3::Zero(), Vec3::UnitZ()), 321);
}

TEST(PathTracerLights, ReflectInAClosedRoom) {
  // All that a lamp in a closed white room gives is absorbed: the mean of E·(1 − ρ)·A is 4π·I.
  Scene scene;
  AddRoom(scene, AddMaterial(scene, 0.5, 0), Vec3::Zero(), Vec3(3, 2, 2));
  scene.lights = {Lamp(PunctualLight::Kind::kPoint, {1, 0.7, 1.2}, -Vec3::UnitZ(), 10)};
  const TracedScene traced(scene);
  const PathTracer tracer(traced);
  double sum = 0;
  const std::vector<Place> probes = DrawProbes(traced, 2048, 1);
  for (std::size_t i = 0; i < probes.size(); ++i) {
    sum += tracer.Irradiance(probes[i], 16, i).irradiance[0];
  }
  const double mean = sum / static_cast<double>(probes.size()) * pi * traced.brightest;
  EXPECT_NEAR(mean / (4 * pi * 10 / (0.5 * 32)), 1, 0.01);
}

TEST(PathTracerSky, LightsAnOpenPlaneWithPiTimesItsRadiance) {
  Scene scene = Floor(0.5);
  scene.environment = Rgb(3, 2, 0);
  ExpectMeasured(Measure(scene, {1, 2, 0}, Vec3::UnitZ()), 3 * pi);
  const TracedScene traced(scene);
  const Rgb e = PathTracer(traced)
                    .Irradiance({.point = Vec3(0.1, 0.2, 0), .normal = Vec3::UnitZ()}, 4096, 1)
                    .irradiance;
  EXPECT_NEAR(e[1] / e[0], 2.0 / 3, 1e-9);
  EXPECT_EQ(e[2], 0);
}

TEST(PathTracerSky, IsHiddenByAWallAsItsFormFactorSays) {
  for (const double distance : {1.0, 0.01}) {
    Scene scene = Floor();
    scene.environment = Rgb::Constant(2);
    constexpr double kHeight = 3;
    constexpr double kHalfWidth = 5;
    // A black wall that stands on the floor `distance` away and looks at the point.
    AddQuad(scene, AddMaterial(scene, 0, 0), {distance, -kHalfWidth, 0}, kHeight * Vec3::UnitZ(),
            2 * kHalfWidth * Vec3::UnitY());
    // Howell's catalogue, B-4: an element to a perpendicular rectangle over the line below it.
    const double slant = std::hypot(distance, kHeight);
    const double factor =
        (std::atan(kHalfWidth / distance) - distance / slant * std::atan(kHalfWidth / slant)) / pi;
    ExpectMeasured(Measure(scene, Vec3::Zero(), Vec3::UnitZ()), 2 * pi * (1 - factor));
  }
}

TEST(PathTracerSky, FillsAFurnaceThatIsOpenToIt) {
  // Where every surface gives (1 − ρ)·L and the sky L, radiance is L everywhere.
  Scene scene;
  constexpr double kReflectance = 0.7;
  AddRoom(scene, AddMaterial(scene, kReflectance, 5 * (1 - kReflectance)), Vec3::Zero(), Vec3(1, 2, 1));
  scene.surfaces.erase(scene.surfaces.begin() + 1);  // the ceiling
  scene.environment = Rgb::Constant(5);
  const TracedScene traced(scene);
  const PathTracer tracer(traced);
  for (const Place& place : DrawProbes(traced, 12, 3)) {
    ExpectMeasured(Measure(traced, tracer, place, 7), 5 * pi);
  }
}

TEST(PathTracerSky, ConvergesThroughASmallWindow) {
  // A black room whose ceiling has a hole of 6 cm at its centre, which is a lamp of that size as seen from
  // below.
  constexpr double kHole = 0.06;
  Scene scene;
  const Index black = AddMaterial(scene, 0, 0);
  AddRoom(scene, black, {-1, -1, 0}, {2, 2, 1});
  scene.surfaces.erase(scene.surfaces.begin() + 1);
  const double rim = 1 - kHole / 2;
  for (const double side : {-1.0, kHole / 2}) {
    AddQuad(scene, black, {-1, side, 1}, rim * Vec3::UnitY(), 2 * Vec3::UnitX());
    AddQuad(scene, black, {side, -kHole / 2, 1}, kHole * Vec3::UnitY(), rim * Vec3::UnitX());
  }
  scene.environment = Rgb::Constant(1000);
  const double expected = 1000 * 4 * UnderCornerOfRectangle(kHole / 2, kHole / 2, 1);
  // Of 2048 rays by the cosine two or three would find it.
  ASSERT_LT(expected / (1000 * pi) * 2048, 3);
  ExpectMeasured(Measure(scene, Vec3::Zero(), Vec3::UnitZ()), expected);
}

TEST(PathTracerSky, IsNotSeenFromAClosedRoom) {
  Scene scene = Furnace(0.5, 2);
  scene.environment = Rgb::Constant(1e9);
  ExpectMeasured(Measure(scene, {0.3, 0.4, 0}, Vec3::UnitZ()), FurnaceIrradiance(0.5, 2));
}

TEST(PathTracerLights, AThousandLampsAreNotNoisierThanAFew) {
  // A long corridor under a row of lamps of all three kinds: no more than a few of them light a place.
  Scene scene;
  AddQuad(scene, AddMaterial(scene, 0, 0), {0, -1, 0}, 1000 * Vec3::UnitX(), 2 * Vec3::UnitY());
  const Index lamp = AddMaterial(scene, 0, 50);
  double expected = 0;
  constexpr double kX = 500.2;
  for (int i = 0; i < 1000; ++i) {
    const double x = i + 0.5;
    const double d = std::hypot(x - kX, 1);
    if (i % 3 == 0) {
      AddQuad(scene, lamp, {x - 0.1, -0.1, 1}, 0.2 * Vec3::UnitY(), 0.2 * Vec3::UnitX());
      const auto half = [&](double to) {
        return UnderCornerOfRectangle(std::abs(to), 0.1, 1) * (to < 0 ? -2 : 2);
      };
      expected += 50 * (half(x + 0.1 - kX) - half(x - 0.1 - kX));
    } else {
      scene.lights.push_back(Lamp(i % 3 == 1 ? PunctualLight::Kind::kPoint : PunctualLight::Kind::kSpot,
                                  {x, 0, 1}, -Vec3::UnitZ(), 2));
      scene.lights.back().outer_cosine = 0;
      expected += 2 / (d * d * d) * (i % 3 == 1 ? 1 : 1 / (d * d));
    }
  }
  const Measured measured = Measure(scene, {kX, 0, 0}, Vec3::UnitZ());
  EXPECT_NEAR(measured.irradiance, expected, 5 * measured.standard_error);
  EXPECT_LT(measured.standard_error, 0.02 * expected);
}

}  // namespace
}  // namespace radbake
