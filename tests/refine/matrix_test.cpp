#include "solver/refine/matrix.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "tests/solve/solved_scene_test.h"
#include "tests/test_scenes.h"

namespace radbake {
namespace {

using testing::SolvedScene;

SolveOptions Matrix(double a_min) {
  SolveOptions options;
  options.refinement = Refinement::kMatrix;
  options.a_min = a_min;
  options.visibility_rays = 2;
  return options;
}

TEST(Matrix, LinksEveryTwoLeavesThatFaceOneAnother) {
  const double a_min = 3e-3;
  const SolvedScene solved(testing::FurnaceBox(0.5), Matrix(a_min));
  const Hierarchy& hierarchy = solved.hierarchy;
  std::size_t leaves = 0;
  for (Index e = 0; e < hierarchy.size(); ++e) {
    if (hierarchy[e].IsLeaf()) {
      EXPECT_LE(hierarchy[e].area, a_min * solved.patches.area);
      EXPECT_GT(hierarchy[e].area, 0.25 * a_min * solved.patches.area);
      ++leaves;
    }
  }
  ASSERT_GT(leaves, 300U);
  // On each of the six sides a sixth of the leaves: they face the other five sixths.
  EXPECT_EQ(solved.solution.links.size(), leaves * leaves * 5 / 6);
  std::set<std::pair<Index, Index>> pairs;
  for (const Link& link : solved.solution.links.all()) {
    EXPECT_TRUE(hierarchy[link.receiver].IsLeaf() && hierarchy[link.shooter].IsLeaf());
    EXPECT_NE(hierarchy.PatchOf(link.receiver).normal, hierarchy.PatchOf(link.shooter).normal);
    pairs.emplace(link.receiver, link.shooter);
  }
  EXPECT_EQ(pairs.size(), solved.solution.links.size());
}

}  // namespace
}  // namespace radbake
