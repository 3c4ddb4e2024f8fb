/// The final gather by rays, where the answer is known: in furnaces.
#include <gtest/gtest.h>

#include <numbers>

#include "solver/bake/gather.h"
#include "solver/transport/sampling.h"
#include "tests/solve/solved_scene_test.h"
#include "tests/test_scenes.h"

namespace radbake {
namespace {

using std::numbers::pi;
using testing::SolvedScene;

SolveOptions Coarse() {
  SolveOptions options;
  options.w_min = 1e-3;
  options.a_min = 1e-3;
  return options;
}

/// Near the corner 0 of a patch.
Vec3 AtCorner(const Hierarchy& hierarchy, Index patch) {
  const Polygon shape = hierarchy.Shape(patch);
  return shape[0] + 0.01 * (shape.Centroid() - shape[0]);
}

TEST(RayGather, OfAFurnaceIsItsIrradianceUpToTheCorners) {
  SolvedScene solved(testing::FurnaceBox(0.5), Coarse());
  GatherOptions options;
  options.by_rays = true;
  options.rays = 4096;
  options.full_area = 1e-6;
  const Gatherer gatherer(solved.hierarchy, solved.solution.light, solved.solution.links, solved.visibility,
                          options);
  const double expected = pi / (1 - 0.5) / solved.patches.normalization.radiance;
  for (Index patch = 0; patch < solved.hierarchy.surface_root_count(); ++patch) {
    for (const Vec3& x : {solved.hierarchy.Centre(patch), AtCorner(solved.hierarchy, patch)}) {
      const Estimate estimate = gatherer.Irradiance(x, gatherer.SolverLeaf(patch, x), patch);
      EXPECT_NEAR(estimate.irradiance[0] / expected, 1, 0.01);
      EXPECT_LT(std::sqrt(estimate.variance) / expected, 0.02);
    }
  }
}

TEST(RayGather, SaysByHowMuchItsAnswersDiffer) {
  SolvedScene solved(testing::ShadowRoom(), Coarse());
  GatherOptions options;
  options.by_rays = true;
  options.full_area = 1e-6;
  for (const int rays : {16, 64, 256}) {
    options.rays = rays;
    const Gatherer gatherer(solved.hierarchy, solved.solution.light, solved.solution.links, solved.visibility,
                            options);
    double said = 0;
    double measured = 0;
    for (Index patch = 0; patch < solved.hierarchy.surface_root_count(); ++patch) {
      const Vec3 x = solved.hierarchy.Centre(patch) + Vec3::Constant(1e-9);
      constexpr int kTimes = 64;
      Rgb sum = Rgb::Zero();
      Rgb squares = Rgb::Zero();
      for (int k = 0; k < kTimes; ++k) {
        const Estimate estimate =
            gatherer.Irradiance(x, gatherer.SolverLeaf(patch, x), Hash(1000 * patch + static_cast<Index>(k)));
        sum += estimate.irradiance / kTimes;
        squares += estimate.irradiance.square() / kTimes;
        said += estimate.variance / kTimes;
      }
      measured += (squares - sum.square()).sum() * kTimes / (kTimes - 1);
    }
    EXPECT_GT(said, 0.8 * measured) << rays;
    EXPECT_LT(said, 1.6 * measured) << rays;
  }
}

TEST(RayGather, FromManyEmittersIsWhatAllOfThemGive) {
  const Scene scene = testing::FurnaceSphere(0.5, 2);
  const Patches patches = CutIntoPatches(scene);
  const Hierarchy hierarchy(patches, true);
  const Visibility visibility(patches);
  const Emitters emitters(hierarchy);
  const double expected = pi / patches.normalization.radiance;
  double mean = 0;
  for (Index patch = 0; patch < 320; ++patch) {
    const Estimate estimate = emitters.At(visibility, hierarchy.Centre(patch),
                                          hierarchy.PatchOf(patch).normal, expected, 256, patch);
    mean += estimate.irradiance[0] / expected / 320;
    EXPECT_NEAR(estimate.irradiance[0] / expected, 1, 0.3) << patch;
  }
  EXPECT_NEAR(mean, 1, 0.005);
}

}  // namespace
}  // namespace radbake
