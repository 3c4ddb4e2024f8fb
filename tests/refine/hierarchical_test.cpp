#include "solver/refine/hierarchical.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "solver/gltf/document.h"
#include "solver/refine/linker.h"
#include "tests/test_scenes.h"

namespace radbake {
namespace {

Link Between(Index receiver, Index shooter) {
  Link link;
  link.receiver = receiver;
  link.shooter = shooter;
  return link;
}

/// Two plates that face one another, `height` m apart: one of 1 m², patch 0, and one of 4 m², patch 1.
Scene TwoPlates(double height = 0.5) {
  Scene scene;
  const Index material = testing::AddMaterial(scene, 0.5, 1);
  testing::AddQuad(scene, material, Vec3(0, 0, 0), Vec3(0, 0, 1), Vec3(1, 0, 1), Vec3(1, 0, 0));
  testing::AddQuad(scene, material, Vec3(0, height, 0), Vec3(2, height, 0), Vec3(2, height, 2),
                   Vec3(0, height, 2));
  return scene;
}

TEST(HierarchicalOracle, KeepsLinksOfSmallFormFactorsEachWay) {
  const Patches patches = CutIntoPatches(TwoPlates());
  const Hierarchy hierarchy(patches);
  EXPECT_EQ(HierarchicalOracle(0, 0.99).Judge(hierarchy, Between(0, 1)), Decision::kKeep);
  EXPECT_NE(HierarchicalOracle(0, 0.3).Judge(hierarchy, Between(0, 1)), Decision::kKeep);
}

TEST(HierarchicalOracle, AsksForLessWhereOneIsHiddenInPart) {
  const Patches patches = CutIntoPatches(TwoPlates(4));
  const Hierarchy hierarchy(patches);
  const auto judge = [&](float visibility, double f_max) {
    Link link = Between(0, 1);
    link.visibility = visibility;
    return HierarchicalOracle(0, f_max).Judge(hierarchy, link);
  };
  double least = 1;  // F_max that the link is kept at
  while (judge(1, 0.99 * least) == Decision::kKeep) {
    least *= 0.99;
  }
  ASSERT_LT(4.1 * least, 1);
  EXPECT_EQ(judge(0, least), Decision::kKeep);
  EXPECT_NE(judge(0.5, least), Decision::kKeep);
  EXPECT_NE(judge(0.5, 3.9 * least), Decision::kKeep);
  EXPECT_EQ(judge(0.5, 4.1 * least), Decision::kKeep);
}

TEST(HierarchicalOracle, DividesTheLargerEnd) {
  const Patches patches = CutIntoPatches(TwoPlates());
  const Hierarchy hierarchy(patches);
  const HierarchicalOracle oracle(0, 0.01);
  EXPECT_EQ(oracle.Judge(hierarchy, Between(0, 1)), Decision::kDivideShooter);
  EXPECT_EQ(oracle.Judge(hierarchy, Between(1, 0)), Decision::kDivideReceiver);
}

TEST(HierarchicalOracle, KeepsWhateverIsBelowTheSmallestAreaAtBothEnds) {
  const Patches patches = CutIntoPatches(TwoPlates());
  const Hierarchy hierarchy(patches);
  const double small = hierarchy[0].area;
  const double large = hierarchy[1].area;
  EXPECT_EQ(HierarchicalOracle(1.01 * large, 0.01).Judge(hierarchy, Between(0, 1)), Decision::kKeep);
  const HierarchicalOracle between(2 * small, 0.01);
  EXPECT_EQ(between.Judge(hierarchy, Between(0, 1)), Decision::kDivideShooter);
  EXPECT_EQ(between.Judge(hierarchy, Between(1, 0)), Decision::kDivideReceiver);
}

TEST(HierarchicalOracle, DividesWhatSeesAPartOfTheSky) {
  Scene scene = TwoPlates();
  scene.environment = Rgb::Ones();
  const Patches patches = CutIntoPatches(scene);
  const Hierarchy hierarchy(patches);
  const Index sky = static_cast<Index>(hierarchy.surface_root_count());
  const double area = hierarchy[0].area;
  Link link = Between(0, sky);
  const auto judge = [&](float visibility, double a_min) {
    link.visibility = visibility;
    return HierarchicalOracle(a_min, 0.99).Judge(hierarchy, link);
  };
  EXPECT_EQ(judge(1, 0.1 * area), Decision::kKeep);
  EXPECT_EQ(judge(0, 0.1 * area), Decision::kKeep);
  EXPECT_EQ(judge(0.5, 0.1 * area), Decision::kDivideReceiver);
  EXPECT_EQ(judge(0.5, 1.1 * area), Decision::kKeep);
}

struct Count {
  double elements = 0;
  double leaves = 0;
  double links = 0;
};

Count LinkCornellBox(const Patches& patches, double a_min, double f_max) {
  Hierarchy hierarchy(patches);
  const Visibility visibility(patches);
  constexpr int kRays = 2;
  Linker linker(hierarchy, visibility, kRays, kRays);
  linker.LinkRoots();
  linker.Refine(HierarchicalOracle(a_min * patches.area, f_max), {});
  Count count;
  for (Index e = 0; e < hierarchy.size(); ++e) {
    count.leaves += hierarchy[e].IsLeaf() ? 1 : 0;
  }
  count.elements = static_cast<double>(hierarchy.size());
  count.links = static_cast<double>(linker.links().size());
  return count;
}

// Measured, like what begins with Accuracy: it takes too long under a sanitizer.
TEST(Growth, OfLinksIsLinearInElementsUnderTheStaticOracle) {
  const gltf::Document document(gltf::ReadSource(RADBAKE_SOURCE_DIR "/scenes/cornell-box.glb"));
  const Patches patches = CutIntoPatches(document.scene());
  constexpr double kFMax = 0.1;
  std::vector<Count> counts;
  for (const double a_min : {1.6e-3, 4e-4, 1e-4, 2.5e-5}) {
    counts.push_back(LinkCornellBox(patches, a_min, kFMax));
  }
  const Count& last = counts.back();
  EXPECT_GE(last.elements, 10'000);
  EXPECT_LT(last.links, 0.02 * last.leaves * last.leaves) << "of the matrix of the leaves";

  // The slope of the regression line of ln links over ln elements.
  double x = 0;
  double y = 0;
  double xx = 0;
  double xy = 0;
  for (const Count& count : counts) {
    x += std::log(count.elements);
    y += std::log(count.links);
    xx += std::log(count.elements) * std::log(count.elements);
    xy += std::log(count.elements) * std::log(count.links);
  }
  const auto n = static_cast<double>(counts.size());
  const double exponent = (n * xy - x * y) / (n * xx - x * x);
  EXPECT_LE(exponent, 1.1);
  EXPECT_GT(exponent, 0.5) << "the settings must differ for a slope to mean anything";
}

}  // namespace
}  // namespace radbake
