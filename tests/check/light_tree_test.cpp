#include "solver/check/light_tree.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/check/check_scenes_test.h"

namespace radbake {
namespace {

/// Random lamps in the unit cube, of all kinds, and a place amid them.
std::vector<LightTree::Lamp> RandomLamps(std::size_t count) {
  std::vector<LightTree::Lamp> lamps;
  for (std::size_t i = 0; i < count; ++i) {
    const auto random = [&](std::uint64_t k) { return RandomNumber(100 * i + k); };
    LightTree::Lamp lamp;
    lamp.centre = Vec3(random(0), random(1), random(2));
    lamp.radius = i % 3 == 0 ? 0 : 0.05 * random(3);
    lamp.weight = 0.01 + random(4);
    lamp.axis = Vec3(random(5) - 0.5, random(6) - 0.5, random(7) - 0.5).normalized();
    lamp.cosine = 2 * random(8) - 1;
    lamps.push_back(lamp);
  }
  return lamps;
}

const Place kPlace{.point = Vec3(0.4, 0.5, 0.3), .normal = Vec3(0.6, 0, 0.8)};

TEST(LightTree, ChoosesAsOftenAsItsProbabilitiesSay) {
  const std::vector<LightTree::Lamp> lamps = RandomLamps(23);
  const LightTree tree(lamps);
  constexpr int kDraws = 200000;
  std::vector<int> chosen(lamps.size());
  int none = 0;
  for (int i = 0; i < kDraws; ++i) {
    const auto choice = tree.Choose(kPlace, (i + 0.5) / kDraws);
    if (choice) {
      ++chosen[choice->lamp];
      EXPECT_GE(choice->rest, 0);
      EXPECT_LT(choice->rest, 1);
      EXPECT_NEAR(choice->probability, tree.Probability(choice->lamp, kPlace), 1e-12);
    } else {
      ++none;
    }
  }
  double sum = static_cast<double>(none) / kDraws;
  for (Index i = 0; i < lamps.size(); ++i) {
    // Each lamp has one interval of u.
    EXPECT_NEAR(static_cast<double>(chosen[i]) / kDraws, tree.Probability(i, kPlace), 2.0 / kDraws);
    sum += tree.Probability(i, kPlace);
  }
  EXPECT_NEAR(sum, 1, 1e-4);
}

TEST(LightTree, LeavesNoLampOutThatCanLightThePlace) {
  const std::vector<LightTree::Lamp> lamps = RandomLamps(500);
  const LightTree tree(lamps);
  int lit = 0;
  for (Index i = 0; i < lamps.size(); ++i) {
    const Vec3 way = lamps[i].centre - kPlace.point;
    if (kPlace.normal.dot(way) > 0 && -lamps[i].axis.dot(way) > lamps[i].cosine * way.norm()) {
      ++lit;
      EXPECT_GT(tree.Probability(i, kPlace), 0) << i;
    }
  }
  EXPECT_GT(lit, 50);
}

TEST(LightTree, PrefersTheNearLamp) {
  std::vector<LightTree::Lamp> lamps(1000);
  for (std::size_t i = 0; i < lamps.size(); ++i) {
    lamps[i].centre = Vec3(static_cast<double>(i), 0, 1);
    lamps[i].weight = 1;
  }
  // Of Σ cos/d² = Σ 1/(1 + x²)^1.5 on both sides of 500: 1/2.404.
  const LightTree tree(lamps);
  EXPECT_GT(tree.Probability(500, {.point = Vec3(500, 0, 0), .normal = Vec3::UnitZ()}), 0.25);
}

TEST(LightTree, ChoosesNothingBelowTheHorizonAndOutsideOfAllCones) {
  std::vector<LightTree::Lamp> lamps(2);
  for (LightTree::Lamp& lamp : lamps) {
    lamp.centre = Vec3::UnitZ();
    lamp.weight = 1;
    lamp.axis = Vec3::UnitX();
    lamp.cosine = 0.5;
  }
  lamps[1].centre.x() = 0.1;
  const LightTree tree(lamps);
  EXPECT_FALSE(tree.Choose({.point = Vec3::Zero(), .normal = Vec3::UnitZ()}, 0.3));
  EXPECT_FALSE(tree.Choose({.point = Vec3(3, 0, 1), .normal = Vec3::UnitX()}, 0.3));
  EXPECT_TRUE(tree.Choose({.point = Vec3(3, 0, 1), .normal = -Vec3::UnitX()}, 0.3));
  EXPECT_FALSE(LightTree({}).Choose(kPlace, 0.3));
}

}  // namespace
}  // namespace radbake
