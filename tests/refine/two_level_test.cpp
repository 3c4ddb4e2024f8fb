#include "solver/refine/two_level.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>

#include "solver/refine/linker.h"
#include "tests/solve/solved_scene_test.h"
#include "tests/test_scenes.h"

namespace radbake {
namespace {

using testing::SolvedScene;

constexpr double kAMin = 1e-3;

SolveOptions TwoLevel(double gradient) {
  SolveOptions options;
  options.refinement = Refinement::kTwoLevel;
  options.a_min = kAMin;
  options.gradient = gradient;
  options.tolerance = 1e-9;
  options.visibility_rays = 8;
  return options;
}

constexpr double kNeverSteep = 1e9;

/// The patches as the links tell them: whatever shoots.
std::vector<Index> Shooters(const Links& links) {
  std::vector<Index> shooters;
  for (const Link& link : links.all()) {
    shooters.push_back(link.shooter);
  }
  std::ranges::sort(shooters);
  shooters.erase(std::ranges::unique(shooters).begin(), shooters.end());
  return shooters;
}

TEST(TwoLevel, PatchesShootAndElementsReceive) {
  const SolvedScene solved(testing::ShadowRoom(), TwoLevel(kNeverSteep));
  const Hierarchy& hierarchy = solved.hierarchy;
  const double a_min = kAMin * solved.patches.area;
  const std::vector<Index> shooters = Shooters(solved.solution.links);
  for (const Index patch : shooters) {
    EXPECT_LE(hierarchy[patch].area, 64 * a_min);
    EXPECT_TRUE(hierarchy[patch].parent == kNone || hierarchy[hierarchy[patch].parent].area > 64 * a_min);
  }
  for (const Link& link : solved.solution.links.all()) {
    EXPECT_TRUE(hierarchy[link.receiver].IsLeaf());
    EXPECT_LE(hierarchy[link.receiver].area, 4 * a_min);
    EXPECT_GT(hierarchy[link.receiver].area, 0.5 * a_min);
  }
  EXPECT_EQ(PatchLevel(hierarchy, 64 * a_min), shooters);
}

TEST(TwoLevel, SolvesThePatchesByTheMeansOfTheirElementsFormFactors) {
  SolveOptions options = TwoLevel(kNeverSteep);
  options.a_min = 4e-3;
  const SolvedScene solved(testing::ShadowRoom(), options);
  const Hierarchy& hierarchy = solved.hierarchy;
  const Light& light = solved.solution.light;
  const std::vector<Index> patches = Shooters(solved.solution.links);
  const auto m = static_cast<Eigen::Index>(patches.size());
  std::map<Index, Eigen::Index> number;
  for (const Index patch : patches) {
    number.emplace(patch, static_cast<Eigen::Index>(number.size()));
  }
  Eigen::MatrixXd f = Eigen::MatrixXd::Zero(m, m);  // F_ij = Σ_q F_qj·A_q / A_i
  for (const Link& link : solved.solution.links.all()) {
    Index patch = link.receiver;
    while (!number.contains(patch)) {
      patch = hierarchy[patch].parent;
    }
    f(number[patch], number[link.shooter]) += static_cast<double>(link.form_factor * link.visibility) *
                                              hierarchy[link.receiver].area / hierarchy[patch].area;
  }
  for (Eigen::Index channel = 0; channel < 3; ++channel) {
    Eigen::MatrixXd system = Eigen::MatrixXd::Identity(m, m);
    Eigen::VectorXd emission(m);
    for (const auto& [patch, i] : number) {
      emission[i] = hierarchy.PatchOf(patch).emission[channel];
      for (const auto& [shooter, j] : number) {
        system(i, j) -= hierarchy.PatchOf(patch).reflectance[channel] * f(i, j) / light.open[shooter];
      }
    }
    const Eigen::VectorXd radiosity = system.partialPivLu().solve(emission);
    double worst = 0;
    for (const auto& [patch, i] : number) {
      worst = std::max(worst, std::abs(light.radiosity[patch][channel] / radiosity[i] - 1));
    }
    EXPECT_LT(worst, 1e-5) << "channel " << channel;
    // The elements' radiosities are what these patches give them.
    const auto last = static_cast<Index>(hierarchy.size() - 1);
    for (const Index leaf : {solved.solution.links.all().front().receiver, last - 30, last}) {
      double irradiance = 0;
      for (const Link& link : solved.solution.links.Into(leaf)) {
        irradiance += static_cast<double>(link.form_factor * link.visibility) *
                      radiosity[number[link.shooter]] / light.open[link.shooter];
      }
      if (hierarchy[leaf].IsLeaf()) {
        EXPECT_NEAR(light.irradiance[leaf][channel], irradiance, 1e-5 * irradiance);
      }
    }
  }
}

TEST(TwoLevel, DividesElementsWhereNeighboursDifferAndComputesTheirRowsAlone) {
  const SolvedScene even(testing::ShadowRoom(), TwoLevel(kNeverSteep));
  const SolvedScene solved(testing::ShadowRoom(), TwoLevel(0.3));
  const std::vector<Iteration>& iterations = solved.solution.iterations;
  ASSERT_EQ(even.solution.iterations.size(), 1U);
  ASSERT_GE(iterations.size(), 2U);
  EXPECT_EQ(iterations[0].factors, even.solution.iterations[0].factors);

  const Links& before = even.solution.links;
  const Links& after = solved.solution.links;
  std::size_t divided_rows = 0;
  std::size_t kept_rows = 0;
  for (Index e = 0; e < even.hierarchy.size(); ++e) {
    if (!even.hierarchy[e].IsLeaf()) {
      continue;
    }
    if (solved.hierarchy[e].first_child < iterations[1].elements) {
      divided_rows += before.Into(e).size();
      EXPECT_TRUE(after.Into(e).empty());
    } else if (solved.hierarchy[e].IsLeaf()) {
      ++kept_rows;
      ASSERT_EQ(before.Into(e).size(), after.Into(e).size());
      for (std::size_t k = 0; k < before.Into(e).size(); ++k) {
        EXPECT_EQ(before.Into(e)[k].form_factor, after.Into(e)[k].form_factor);
      }
    }
  }
  EXPECT_GT(kept_rows, 100U);
  EXPECT_GT(divided_rows, 1000U);
  EXPECT_GT(iterations.back().factors, iterations[0].factors);
  EXPECT_EQ(iterations[1].factors - iterations[0].factors, 4 * divided_rows);
}

TEST(TwoLevel, FindsNoSteepElementWhereTheLightIsEven) {
  const SolvedScene solved(testing::FurnaceBox(0.5), TwoLevel(0.01));
  EXPECT_EQ(solved.solution.iterations.size(), 1U);
}

TEST(TwoLevel, FindsTheElementsOnBothSidesOfAStep) {
  const SolvedScene solved(testing::FurnaceBox(0.5), TwoLevel(kNeverSteep));
  Light light = solved.solution.light;
  // Left half 1, right half 2.
  const auto is_left = [&](Index e) { return solved.hierarchy.Shape(e).Centroid()[0] < 0; };
  for (Index e = 0; e < solved.hierarchy.size(); ++e) {
    light.irradiance[e] = Rgb::Constant(is_left(e) ? 1 : 2);
  }
  const std::vector<Index> steep = SteepElements(solved.hierarchy, light, 0.5, 0);
  EXPECT_GT(steep.size(), 20U);
  for (const Index e : steep) {
    EXPECT_LT(std::abs(solved.hierarchy.Shape(e).Centroid()[0]), 0.1);
  }
  EXPECT_TRUE(SteepElements(solved.hierarchy, light, 0.7, 0).empty()) << "1 of the root of (1 + 4) / 2";
  EXPECT_TRUE(SteepElements(solved.hierarchy, light, 0.5, 1).empty()) << "none is as large";
}

}  // namespace
}  // namespace radbake
