// The same scene, small, large and far away; dim and bright.
#include <functional>

#include "solver/gltf/document.h"
#include "tests/extremes/extremes_test.h"

namespace radbake {
namespace {

using testing::Bake;
using testing::Baked;
using testing::DeviationFrom;
using testing::Difference;

const Scene& CornellBox() {
  static const Scene kScene =
      gltf::Document(gltf::ReadSource(RADBAKE_SOURCE_DIR "/scenes/cornell-box.glb")).scene();
  return kScene;
}

const Baked& BakedCornellBox() {
  static const Baked kBaked = Bake(CornellBox());
  return kBaked;
}

Scene Moved(Scene scene, const std::function<Vec3(const Vec3&)>& move) {
  for (Surface& surface : scene.surfaces) {
    for (Vec3& position : surface.positions) {
      position = move(position);
    }
  }
  return scene;
}

/// As the vertices of a file are stored.
Vec3 Rounded(const Vec3& position) {
  return position.cast<float>().cast<double>();
}

double DifferenceOf(const Scene& moved, double brightness = 1) {
  return Difference(BakedCornellBox(), Bake(moved), 1 / brightness);
}

TEST(Extremes, ABoxOfAnySizeHasTheSameLight) {
  for (const double scale : {1e-6, 1e-3, 1e3, 1e6}) {
    EXPECT_LT(DifferenceOf(Moved(CornellBox(), [&](const Vec3& p) { return Rounded(scale * p); })), 1e-3)
        << scale;
  }
}

TEST(Extremes, ABoxThatANodeMovesFarAwayHasTheSameLight) {
  EXPECT_LT(DifferenceOf(Moved(CornellBox(), [](const Vec3& p) { return Vec3(p + Vec3(1e5, -1e5, 1e5)); })),
            1e-3);
}

// 1e5 m from the origin the vertices of a file lie on a grid of 1/128 m, 1.4 % of the box: that is what is
// baked, and nothing is lost besides.
TEST(Extremes, ABoxWithVerticesFarAwayHasTheLightOfItsRoundedSelf) {
  const Vec3 away(1e5, -1e5, 1e5);
  const Scene far = Moved(CornellBox(), [&](const Vec3& p) { return Rounded(p + away); });
  const Scene near = Moved(far, [&](const Vec3& p) { return Vec3(p - away); });
  EXPECT_LT(Difference(Bake(near), Bake(far)), 1e-3);
}

// A box of 1 km there is rounded by 1e-5 of its size.
TEST(Extremes, ALargeBoxWithVerticesFarAwayHasTheSameLight) {
  const double scale = 2000;
  EXPECT_LT(DifferenceOf(Moved(CornellBox(),
                               [&](const Vec3& p) { return Rounded(scale * p + Vec3(1e5, -1e5, 1e5)); })),
            1e-3);
}

Scene Brightened(Scene scene, const Rgb& factor) {
  for (Material& material : scene.materials) {
    material.emission *= factor;
  }
  return scene;
}

TEST(Extremes, LightOfAnyBrightnessIsAsExact) {
  for (const double factor : {1e-12, 1e12}) {
    EXPECT_LT(DifferenceOf(Brightened(CornellBox(), Rgb::Constant(factor)), factor), 1e-6) << factor;
  }
}

TEST(Extremes, ChannelsOf24DecadesDoNotMix) {
  Scene grey = CornellBox();
  for (Material& material : grey.materials) {
    material.reflectance = Rgb::Constant(material.reflectance[0]);
    material.emission = Rgb::Constant(material.emission[0]);
  }
  const Scene mixed = Brightened(grey, Rgb(1e-12, 1, 1e12));
  for (const Rgb& e : Bake(mixed).triangles.irradiance) {
    EXPECT_NEAR(e[0], 1e-12 * e[1], 1e-16 * e[1]);
    EXPECT_NEAR(e[2], 1e12 * e[1], 1e8 * e[1]);
  }
}

TEST(Extremes, RoomsOf24DecadesInOneSceneAreEachAsExact) {
  constexpr double kWalls = 0.9;
  Scene scene;
  const std::array<double, 3> radiance = {1e12, 1, 1e-12};
  for (std::size_t i = 0; i < radiance.size(); ++i) {
    const Vec3 low(2.0 * static_cast<double>(i), 0, 0);
    testing::AddBox(scene, testing::AddMaterial(scene, kWalls, radiance[i]), low, low + Vec3::Ones(), true);
  }
  const auto expected = [&](std::size_t, const Vec3& position) {
    return std::numbers::pi * radiance[static_cast<std::size_t>(position.x() / 2)] / (1 - kWalls);
  };
  for (const Refinement refinement : {Refinement::kHierarchical, Refinement::kAdaptive}) {
    SolveOptions options = testing::CoarseSolve();
    options.refinement = refinement;
    EXPECT_LT(DeviationFrom(Bake(scene, options), expected).worst, 1e-3);
  }
}

TEST(Extremes, FurnacesThatReflectNearlyEverythingAreSolvedInFewSteps) {
  for (const double reflectance : {0.999, 0.9999}) {
    for (const Scene& scene : {testing::FurnaceBox(reflectance), testing::FurnaceSphere(reflectance, 1)}) {
      for (const Refinement refinement : {Refinement::kHierarchical, Refinement::kAdaptive}) {
        SolveOptions options = testing::CoarseSolve();
        options.refinement = refinement;
        options.f_max = 0.1;
        options.a_min = 4e-3;
        testing::SolvedScene solved(scene, options);
        std::size_t applications = 0;
        for (const Iteration& iteration : solved.solution.iterations) {
          applications += iteration.sweeps;
        }
        EXPECT_LE(applications, 40U);
        EXPECT_LT(DeviationFrom(Bake(scene, solved), std::numbers::pi / (1 - reflectance)).worst, 1e-3)
            << scene.surfaces.size() << " surfaces, reflectance " << reflectance;
      }
    }
  }
}

}  // namespace
}  // namespace radbake
