#include "solver/solve/krylov.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/solve/solved_scene_test.h"
#include "tests/test_scenes.h"

namespace radbake {
namespace {

using testing::SolvedScene;

SolveOptions Coarse(Refinement refinement, IterationMethod iteration) {
  SolveOptions options;
  options.refinement = refinement;
  options.iteration = iteration;
  options.a_min = 1e-3;
  options.f_max = 0.1;
  options.w_min = 1e-3;
  return options;
}

std::size_t Applications(const Solution& solution) {
  std::size_t applications = 0;
  for (const Iteration& iteration : solution.iterations) {
    applications += iteration.sweeps;
  }
  return applications;
}

TEST(Krylov, FindsWhatSweepsFindInFewerApplications) {
  for (const double reflectance : {0.7, 0.99}) {
    Scene scene = testing::ShadowRoom();
    scene.materials[0].reflectance = Rgb(reflectance, 0.5 * reflectance, 0);
    scene.materials[2].emission = Rgb(1, 1, 1e-12);
    SolveOptions options = Coarse(Refinement::kHierarchical, IterationMethod::kKrylov);
    options.tolerance = 1e-6;
    const SolvedScene krylov(scene, options);
    options.iteration = IterationMethod::kSweeps;
    const SolvedScene sweeps(scene, options);
    double worst = 0;
    for (Index e = 0; e < krylov.hierarchy.size(); ++e) {
      const Rgb& known = sweeps.solution.light.irradiance[e];
      const Rgb difference = (krylov.solution.light.irradiance[e] - known).abs();
      worst = std::max(worst, (known > 0).select(difference / known, difference).maxCoeff());
    }
    EXPECT_LT(worst, 1e-4) << "reflectance " << reflectance;
    EXPECT_LT(3 * Applications(krylov.solution), 2 * Applications(sweeps.solution));
  }
}

TEST(Krylov, TheResidualIsTrue) {
  SolveOptions options = Coarse(Refinement::kHierarchical, IterationMethod::kKrylov);
  SolvedScene solved(testing::ShadowRoom(), options);
  const Rows rows(solved.hierarchy, solved.solution.links, solved.solution.light);
  const Couplings couplings(solved.hierarchy, solved.visibility, solved.solution.links,
                            solved.solution.light);
  const RadiosityOperator radiosity_operator(solved.hierarchy, solved.solution.links, rows, couplings,
                                             solved.solution.light);
  Light& light = solved.solution.light;
  light.radiosity.assign(light.radiosity.size(), Rgb::Constant(1));
  const auto at_once = [](const Convergence&) { return true; };
  const Convergence convergence =
      IterateByKrylov(radiosity_operator, {.tolerance = 1e-6, .stop = at_once}, light);
  EXPECT_EQ(convergence.applications, 1U);
  // What is left in `light` is the radiosity that was applied, swept once.
  Rgb change = Rgb::Zero();
  Rgb area = Rgb::Zero();
  for (const Index leaf : rows.leaves()) {
    const double leaf_area = solved.hierarchy[leaf].area;
    const Rgb patch = light.radiosity[solved.hierarchy[leaf].patch];
    change += leaf_area * (patch > 0).select(((light.radiosity[leaf] - 1) / patch).square(), 0.0);
    area += leaf_area * (patch > 0).cast<double>();
  }
  EXPECT_NEAR(convergence.residual, (change / area).sqrt().maxCoeff(), 1e-9);
}

TEST(Krylov, LightDoesNotGrowWhereFormFactorsSumToMoreThanOneOverTheReflectance) {
  SolvedScene solved(testing::FurnaceBox(0.98), Coarse(Refinement::kHierarchical, IterationMethod::kKrylov));
  Light& light = solved.solution.light;
  const Rgb known = light.irradiance[0];
  std::vector<Link> too_open(solved.solution.links.all().begin(), solved.solution.links.all().end());
  for (Link& link : too_open) {
    link.visibility = 1.1F;
  }
  Links links;
  links.Assign(too_open, solved.hierarchy.size(), 0);
  const Rows rows(solved.hierarchy, links, light);
  const Couplings couplings(solved.hierarchy, solved.visibility, links, light);
  RadiosityOperator radiosity_operator(solved.hierarchy, links, rows, couplings, light);
  EXPECT_FALSE(radiosity_operator.Grows(light));
  const auto soon = [](const Convergence& convergence) { return convergence.applications > 100; };
  IterateBySweeps(radiosity_operator, {.tolerance = 1e-6, .stop = soon}, light);
  EXPECT_TRUE(radiosity_operator.Grows(light));
  radiosity_operator.Bound();
  IterateByKrylov(radiosity_operator, {.tolerance = 1e-6, .stop = soon}, light);
  EXPECT_FALSE(radiosity_operator.Grows(light));
  EXPECT_LT((light.irradiance[0] / known - 1).abs().maxCoeff(), 1e-3);
}

TEST(Krylov, StopsWithWhatItHasWhenAsked) {
  SolveOptions options = Coarse(Refinement::kHierarchical, IterationMethod::kKrylov);
  std::size_t asked = 0;
  options.stop = [&](const Iteration& iteration) {
    asked += iteration.sweeps > 0 ? 1 : 0;
    return iteration.sweeps > 0;
  };
  const SolvedScene solved(testing::ShadowRoom(), options);
  EXPECT_EQ(asked, 1U);
  EXPECT_TRUE(solved.solution.stopped);
  EXPECT_EQ(Applications(solved.solution), 1U);
  EXPECT_GT(Luminance(solved.solution.light.irradiance[0]), 0) << "the lamp's own light at least";
}

}  // namespace
}  // namespace radbake
