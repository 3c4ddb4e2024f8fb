#include "solver/solve/cluster_push.h"

#include <gtest/gtest.h>

#include <utility>

#include "solver/solve/radiosity_operator.h"
#include "solver/solve/solver.h"
#include "tests/test_scenes.h"

namespace radbake {
namespace {

/// A box of six patches below one cluster.
struct Box {
  explicit Box(bool inwards = true)
      : patches(CutIntoPatches(SceneOf(inwards))),
        hierarchy(patches, true),
        visibility(patches),
        solution(Solve(hierarchy, visibility, Coarsest())) {}
  static Scene SceneOf(bool inwards) {
    Scene scene;
    testing::AddBox(scene, testing::AddMaterial(scene, 0.5, 1), Vec3(0, 0, 0), Vec3(1, 1, 1), inwards);
    PunctualLight& light = scene.lights.emplace_back();
    light.position = Vec3(20, 10, 5);
    light.intensity = Rgb::Ones();
    return scene;
  }
  static SolveOptions Coarsest() {
    SolveOptions options;
    options.w_min = 1;  // no second pass
    return options;
  }
  double MeanOverArea(const std::vector<Rgb>& irradiance) const {
    double power = 0;
    for (Index patch = 0; patch < irradiance.size(); ++patch) {
      power += hierarchy[patch].area * irradiance[patch][0];
    }
    return power / hierarchy.clusters()[0].area;
  }
  Links LinksOf(Link link, std::vector<PatchShare> shares) const {
    Links links;
    link.receiver_count = static_cast<std::uint16_t>(shares.size());
    links.Assign({link}, hierarchy.size(), hierarchy.clusters().size(), std::move(shares));
    return links;
  }

  Patches patches;
  Hierarchy hierarchy;
  Visibility visibility;
  Solution solution;
};

/// Where everything shoots 1.
Shooters Even(const Box& box, const Links& links) {
  return {.elements = std::vector<Rgb>(box.hierarchy.size(), Rgb::Ones()),
          .coefficients = {},
          .clusters = std::vector<Rgb>(links.size(), Rgb::Ones()),
          .punctual = {Rgb::Ones()}};
}

void ExpectThatNoPatchGetsMoreThanItSees(const Box& box, const Links& links) {
  ClusterPush push(box.hierarchy, links, box.solution.light);
  const Shooters even = Even(box, links);
  const std::vector<Rgb> before = push.Push(even);
  std::vector<double> seen;
  double most = 0;
  for (const Rgb& irradiance : before) {
    seen.push_back(irradiance[0]);
    most = std::max(most, irradiance[0]);
  }
  ASSERT_GT(most, 1.3);
  push.Balance(even, seen);
  const std::vector<Rgb> after = push.Push(even);
  EXPECT_NEAR(box.MeanOverArea(after), box.MeanOverArea(before), 1e-5);
  for (const Rgb& irradiance : after) {
    EXPECT_LE(irradiance[0], 1.1);
  }
}

TEST(ClusterPush, WhatRaysBringAPatchBeyondWhatItSeesGoesToOthersOfItsCluster) {
  const Box box;
  ASSERT_EQ(box.hierarchy.clusters().size(), 1U);
  const Link link{.receiver = ClusterNode(0), .shooter = ClusterNode(0), .form_factor = 0.6F};
  ExpectThatNoPatchGetsMoreThanItSees(box, box.LinksOf(link, {{0, 0.4F}, {1, 0.2F}, {2, 0.2F}, {3, 0.2F}}));
}

TEST(ClusterPush, SoDoesWhatComesByOrientation) {
  const Box box(false);
  const Link link{.receiver = ClusterNode(0), .shooter = PunctualNode(0), .form_factor = 0.4F};
  ExpectThatNoPatchGetsMoreThanItSees(box, box.LinksOf(link, {}));
}

TEST(ClusterPush, WhatIsFarTooMuchForAllThatRaysLeftFromFallsOnOthersToo) {
  const Box box;
  const Link link{.receiver = ClusterNode(0), .shooter = ClusterNode(0), .form_factor = 1};
  const Links links = box.LinksOf(link, {{0, 1.0F}});
  ClusterPush push(box.hierarchy, links, box.solution.light);
  const Shooters even = Even(box, links);
  std::vector<double> seen;
  for (const Rgb& irradiance : push.Push(even)) {
    seen.push_back(irradiance[0]);
  }
  push.Balance(even, seen);
  for (const Rgb& irradiance : push.Push(even)) {
    EXPECT_NEAR(irradiance[0], 1, 0.2);
  }
}

TEST(ClusterPush, LightDoesNotGrowBetweenPatchesThatFewRaysMet) {
  Box box;
  const Link link{.receiver = ClusterNode(0), .shooter = ClusterNode(0), .form_factor = 1};
  Link sourced = link;
  sourced.source_count = 2;
  sourced.receiver_count = 2;
  Links links;
  links.Assign({sourced}, box.hierarchy.size(), box.hierarchy.clusters().size(),
               {{0, 0.5F}, {1, 0.5F}, {0, 0.5F}, {1, 0.5F}});
  Light& light = box.solution.light;
  const Rows rows(box.hierarchy, links, light);
  const Couplings couplings(box.hierarchy, box.visibility, links, light);
  const RadiosityOperator radiosity_operator(box.hierarchy, links, rows, couplings, light);
  LeafValues left = LeafValues::Ones(3, radiosity_operator.size());
  for (int reflection = 0; reflection < 4; ++reflection) {
    left = radiosity_operator.Gather(left);
  }
  EXPECT_LT(left.maxCoeff(), 1 + 1e-4);
}

}  // namespace
}  // namespace radbake
