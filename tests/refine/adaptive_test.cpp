#include "solver/refine/adaptive.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include "tests/solve/solved_scene_test.h"
#include "tests/test_scenes.h"

namespace radbake {
namespace {

using testing::SolvedScene;

/// A floor of the given reflectance, patch 0, and a lamp of the same size 1 m above it, patch 1.
struct FloorAndLamp {
  explicit FloorAndLamp(double floor_reflectance) {
    Scene scene;
    testing::AddQuad(scene, testing::AddMaterial(scene, floor_reflectance, 0), Vec3(0, 0, 0), Vec3(0, 0, 1),
                     Vec3(1, 0, 1), Vec3(1, 0, 0));
    testing::AddQuad(scene, testing::AddMaterial(scene, 0.5, 1), Vec3(0, 1, 0), Vec3(1, 1, 0), Vec3(1, 1, 1),
                     Vec3(0, 1, 1));
    patches = CutIntoPatches(scene);
  }
  /// The light of the lamp's emission alone, which `variation` says is uneven.
  Light Emitted(const Hierarchy& hierarchy, double variation) const {
    Light light;
    light.Extend(hierarchy);
    light.variation[1] = variation;
    return light;
  }
  Patches patches;
};

Link LampToFloor() {
  Link link;
  link.receiver = 0;
  link.shooter = 1;
  link.form_factor = link.judged_factor = 0.2F;
  link.variation = 0.1F;
  link.clear = true;
  return link;
}

TEST(AdaptiveOracle, DividesALitReceiverThatTheFormFactorVariesOver) {
  const FloorAndLamp scene(0.5);
  const Hierarchy hierarchy(scene.patches);
  const Light light = scene.Emitted(hierarchy, 0);
  EXPECT_EQ(AdaptiveOracle(light, 0, 1e-3).Judge(hierarchy, LampToFloor()), Decision::kDivideReceiver);
  EXPECT_EQ(AdaptiveOracle(light, 0, 10).Judge(hierarchy, LampToFloor()), Decision::kKeep);
  const double above = 1.01 * hierarchy[0].area;
  EXPECT_EQ(AdaptiveOracle(light, above, 1e-3).Judge(hierarchy, LampToFloor()), Decision::kKeep);
}

TEST(AdaptiveOracle, DividesABlackReceiverOnlyAsFarAsTheEnergyBalanceAsks) {
  const FloorAndLamp white(0.5);
  const FloorAndLamp black(0);
  const auto judge = [](const FloorAndLamp& scene, const Link& link, double w_min) {
    const Hierarchy hierarchy(scene.patches);
    return AdaptiveOracle(scene.Emitted(hierarchy, 0), 0, w_min).Judge(hierarchy, link);
  };
  Link link = LampToFloor();
  EXPECT_EQ(judge(white, link, 0.01), Decision::kDivideReceiver);
  EXPECT_EQ(judge(black, link, 0.01), Decision::kKeep);
  EXPECT_EQ(judge(black, link, 0.001), Decision::kDivideReceiver);
  link.clear = false;
  link.judged = 0.5F;
  EXPECT_EQ(judge(white, link, 0.02), Decision::kDivideReceiver);
  EXPECT_EQ(judge(black, link, 0.02), Decision::kKeep);
}

TEST(AdaptiveOracle, DividesAShooterThatShinesUnevenly) {
  const FloorAndLamp scene(0);
  const Hierarchy hierarchy(scene.patches);
  EXPECT_EQ(AdaptiveOracle(scene.Emitted(hierarchy, 1), 0, 1e-3).Judge(hierarchy, LampToFloor()),
            Decision::kDivideShooter);
}

TEST(AdaptiveOracle, KeepsALinkFromADarkShooterWhateverItsGeometry) {
  const FloorAndLamp scene(0.5);
  const Hierarchy hierarchy(scene.patches);
  Link link;  // the floor lights the lamp not at all
  link.receiver = 1;
  link.shooter = 0;
  link.form_factor = link.judged_factor = 1;
  link.variation = 1;
  link.judged = 0.5F;
  EXPECT_EQ(AdaptiveOracle(scene.Emitted(hierarchy, 0), 0, 1e-12).Judge(hierarchy, link), Decision::kKeep);
}

TEST(AdaptiveOracle, DividesWhereVisibilityIsUncertain) {
  const FloorAndLamp scene(0.5);
  const Hierarchy hierarchy(scene.patches);
  const Light light = scene.Emitted(hierarchy, 0);
  Link link = LampToFloor();
  link.variation = 0;
  const AdaptiveOracle oracle(light, 0, 1e-3);
  EXPECT_EQ(oracle.Judge(hierarchy, link), Decision::kKeep) << "proved open";
  link.clear = false;
  link.judged = 0.5F;
  EXPECT_NE(oracle.Judge(hierarchy, link), Decision::kKeep);
}

SolveOptions Threshold(double w_min) {
  SolveOptions options;
  options.a_min = 1e-5;
  options.w_min = w_min;
  options.visibility_rays = 8;
  return options;
}

TEST(AdaptiveRefinement, AddsLinksOnlyWhereThereIsEnergy) {
  // A lit room, and far off an unlit one.
  Scene scene = testing::ShadowRoom();
  const std::size_t lit = scene.surfaces.size();
  testing::AddBox(scene, 0, Vec3(500, 0, 0), Vec3(502, 2, 2), true);
  std::size_t elements_before = 0;
  std::size_t links_before = 0;
  for (const double w_min : {4e-3, 1e-3, 2.5e-4}) {
    const SolvedScene solved(scene, Threshold(w_min));
    std::size_t dark_links = 0;
    for (const Link& link : solved.solution.links.all()) {
      if (solved.hierarchy.PatchOf(link.receiver).surface >= lit) {
        EXPECT_EQ(solved.hierarchy[link.receiver].parent, kNone) << "w_min " << w_min;
        ++dark_links;
      }
    }
    EXPECT_GE(dark_links, 30U);
    EXPECT_GT(solved.hierarchy.size(), elements_before + 50);
    EXPECT_GT(solved.solution.links.size(), links_before + 500);
    elements_before = solved.hierarchy.size();
    links_before = solved.solution.links.size();
  }
}

TEST(AdaptiveRefinement, DividesMoreNearTheLightThanFarFromIt) {
  // A corridor of 12 m, a lamp at its near end.
  Scene scene;
  testing::AddBox(scene, testing::AddMaterial(scene, 0.5, 0), Vec3(0, 0, 0), Vec3(12, 2, 2), true);
  testing::AddQuad(scene, testing::AddMaterial(scene, 0, 100), Vec3(0.7, 1.9, 0.7), Vec3(1.3, 1.9, 0.7),
                   Vec3(1.3, 1.9, 1.3), Vec3(0.7, 1.9, 1.3));
  const SolvedScene solved(scene, Threshold(1e-3));
  std::array<std::size_t, 2> leaves{};
  for (Index e = 0; e < solved.hierarchy.size(); ++e) {
    if (solved.hierarchy[e].IsLeaf()) {
      ++leaves[solved.hierarchy.Shape(e).Centroid()[0] < 0 ? 0 : 1];
    }
  }
  EXPECT_GT(leaves[0], 4 * leaves[1]);
}

bool SameLinks(const Links& a, const Links& b) {
  return std::ranges::equal(a.all(), b.all(), [](const Link& x, const Link& y) {
    return x.receiver == y.receiver && x.shooter == y.shooter && x.form_factor == y.form_factor &&
           x.visibility == y.visibility && x.judged == y.judged && x.clear == y.clear;
  });
}

TEST(AdaptiveRefinement, MakesTheSameLinksForTheSameLightInOtherUnits) {
  Scene scene = testing::ShadowRoom();
  const SolvedScene candela(scene, Threshold(1e-3));
  for (Material& material : scene.materials) {
    material.emission *= 0x1p20;
  }
  const SolvedScene scaled(scene, Threshold(1e-3));
  EXPECT_GT(candela.solution.links.size(), 1000U);
  EXPECT_TRUE(SameLinks(candela.solution.links, scaled.solution.links));
}

TEST(AdaptiveRefinement, MakesFewerLinksThanTheStaticOracleForElementsAsSmall) {
  const Scene scene = testing::ShadowRoom();
  SolveOptions options = Threshold(1e-3);
  options.a_min = 1e-3;
  const SolvedScene adaptive(scene, options);
  options.refinement = Refinement::kHierarchical;
  const SolvedScene hierarchical(scene, options);
  EXPECT_LT(adaptive.solution.links.size(), hierarchical.solution.links.size());
}

}  // namespace
}  // namespace radbake
