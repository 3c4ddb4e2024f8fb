/// Closed rooms: what every leaf sees adds up to everything, and furnaces glow evenly.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>
#include <vector>

#include "solver/solve/rows.h"
#include "solver/transport/form_factor.h"
#include "tests/solve/solved_scene_test.h"
#include "tests/test_scenes.h"

namespace radbake {
namespace {

using testing::ForEachLinkInto;
using testing::SolvedScene;

SolveOptions Coarse(Refinement refinement) {
  SolveOptions options;
  options.refinement = refinement;
  options.a_min = 1e-3;
  options.f_max = 0.1;
  options.w_min = 1e-3;
  return options;
}

struct Furnace {
  const char* name;
  Scene scene;
  double reflectance;
  Refinement refinement;
};

std::vector<Furnace> Furnaces(const std::vector<double>& reflectances) {
  std::vector<Furnace> furnaces;
  for (const double reflectance : reflectances) {
    for (const Refinement refinement : {Refinement::kHierarchical, Refinement::kAdaptive}) {
      furnaces.push_back({"box", testing::FurnaceBox(reflectance), reflectance, refinement});
      furnaces.push_back({"sphere", testing::FurnaceSphere(reflectance, 1), reflectance, refinement});
    }
  }
  return furnaces;
}

TEST(Furnace, GlowsEvenlyAtEveryVertex) {
  for (const Furnace& furnace : Furnaces({0.5, 0.9, 0.99})) {
    SolvedScene solved(furnace.scene, Coarse(furnace.refinement));
    MeshOptions mesh;
    mesh.start_area = 2e-3;
    const double expected = std::numbers::pi / (1 - furnace.reflectance);
    double worst = 0;
    std::size_t vertices = 0;
    for (const BakedSurface& surface : solved.Output(mesh).surfaces) {
      EXPECT_TRUE(surface.back.triangles.empty());
      for (const BakedVertex& vertex : surface.front.vertices) {
        worst = std::max(worst, (vertex.irradiance.cast<double>() / expected - 1).abs().maxCoeff());
        ++vertices;
      }
    }
    EXPECT_GT(vertices, 300U);
    EXPECT_LT(worst, 1e-3) << furnace.name << " with reflectance " << furnace.reflectance;
    EXPECT_EQ(solved.visibility.Counted().rays, 0U) << "nothing stands in a convex room";
  }
}

TEST(Furnace, LinksOfALeafAndItsAncestorsCoverAllThatItSeesOnce) {
  for (const Refinement refinement : {Refinement::kHierarchical, Refinement::kAdaptive}) {
    for (const Scene& scene : {testing::FurnaceBox(0.5), testing::FurnaceSphere(0.5, 1)}) {
      const SolvedScene solved(scene, Coarse(refinement));
      const Hierarchy& hierarchy = solved.hierarchy;
      double worst = 0;
      for (Index leaf = 0; leaf < hierarchy.size(); ++leaf) {
        if (!hierarchy[leaf].IsLeaf()) {
          continue;
        }
        const Polygon shape = hierarchy.Shape(leaf);
        double seen = 0;
        ForEachLinkInto(solved.solution.links, hierarchy, leaf, [&](const Link& link) {
          seen += ExchangeArea(shape, hierarchy.Shape(link.shooter)) / hierarchy[leaf].area;
        });
        worst = std::max(worst, std::abs(seen - 1));
      }
      EXPECT_LT(worst, 1e-3);
    }
  }
}

TEST(Furnace, RowsOfEveryLeafSumToOne) {
  for (const Furnace& furnace : Furnaces({0.9})) {
    const SolvedScene solved(furnace.scene, Coarse(furnace.refinement));
    const Rows rows(solved.hierarchy, solved.solution.links, solved.solution.light);
    EXPECT_GE(rows.leaves().size(), solved.hierarchy.root_count());
    double worst = 0;
    for (std::size_t k = 0; k < rows.leaves().size(); ++k) {
      double sum = 0;
      for (const Gathered& entry : rows[k]) {
        sum += static_cast<double>(entry.weight);
      }
      worst = std::max(worst, std::abs(sum - 1));
    }
    EXPECT_LT(worst, 1e-3) << furnace.name << " with reflectance " << furnace.reflectance;
  }
}

/// Σ over all links into the patch's elements of A·F·V, by the patch's area.
std::vector<double> PatchRows(const SolvedScene& solved) {
  std::vector<double> rows(solved.hierarchy.root_count());
  for (const Link& link : solved.solution.links.all()) {
    const Element& receiver = solved.hierarchy[link.receiver];
    rows[receiver.patch] += receiver.area * static_cast<double>(link.form_factor * link.visibility) /
                            solved.hierarchy[receiver.patch].area;
  }
  return rows;
}

TEST(Furnace, RowsOfEveryPatchSumToOne) {
  for (const Furnace& furnace : Furnaces({0.9})) {
    const SolvedScene solved(furnace.scene, Coarse(furnace.refinement));
    double worst = 0;
    for (const double row : PatchRows(solved)) {
      worst = std::max(worst, std::abs(row - 1));
    }
    EXPECT_LT(worst, 1e-3) << furnace.name;
  }
}

TEST(Furnace, LinksBothWaysAreReciprocal) {
  std::size_t pairs = 0;
  double worst = 0;
  for (const Refinement refinement : {Refinement::kHierarchical, Refinement::kAdaptive}) {
    for (const Scene& scene : {testing::FurnaceBox(0.5), testing::FurnaceSphere(0.5, 1)}) {
      const SolvedScene solved(scene, Coarse(refinement));
      std::map<std::pair<Index, Index>, double> exchange;
      for (const Link& link : solved.solution.links.all()) {
        const double there = solved.hierarchy[link.receiver].area * static_cast<double>(link.form_factor);
        const auto back = exchange.find({link.shooter, link.receiver});
        if (back == exchange.end()) {
          exchange[{link.receiver, link.shooter}] = there;
        } else {
          ++pairs;
          worst = std::max(worst, std::abs(there / back->second - 1));
        }
      }
    }
  }
  EXPECT_GT(pairs, 1000U);
  EXPECT_LT(worst, 1e-6);
}

/// The furnace with a box floating in it, off the middle.
Scene FurnaceWithABox() {
  Scene scene = testing::FurnaceBox(0.5);
  testing::AddBox(scene, 0, Vec3(0.2, 0.1, 0.3), Vec3(0.5, 0.6, 0.7), false);
  return scene;
}

TEST(Furnace, VisibleSharesSumToOneAroundAnObjectAsNearAsSamplesCan) {
  for (const Refinement refinement : {Refinement::kHierarchical, Refinement::kAdaptive}) {
    SolveOptions options = Coarse(refinement);
    options.visibility_rays = 64;
    const SolvedScene solved(FurnaceWithABox(), options);
    EXPECT_GT(solved.visibility.Counted().rays, 0U);
    const Hierarchy& hierarchy = solved.hierarchy;
    // A link's visibility is a mean of visibility_rays / 2 samples of 0 or 1 (the other half is the
    // oracle's): its standard error is at most 1/2 over the root of their number, and those of links are
    // independent.
    const double variance = 0.25 / (0.5 * options.visibility_rays);
    double mean = 0;
    double mean_variance = 0;
    for (const Link& link : solved.solution.links.all()) {
      const double share =
          hierarchy[link.receiver].area * static_cast<double>(link.form_factor) / solved.patches.area;
      mean += share * static_cast<double>(link.visibility);
      mean_variance += link.clear ? 0 : share * share * variance;
    }
    EXPECT_NEAR(mean, 1, 1e-3 + 3 * std::sqrt(mean_variance));
    EXPECT_LT(mean_variance, 1e-4) << "else the bound above says nothing";
  }
}

}  // namespace
}  // namespace radbake
