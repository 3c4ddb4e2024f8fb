/// Noise of a known size on an irradiance that is known, over a floor.
#include "solver/bake/smoothing.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <set>

#include "solver/bake/element_centre.h"
#include "tests/solve/solved_scene_test.h"
#include "tests/test_scenes.h"

namespace radbake {
namespace {

using testing::SolvedScene;

SolveOptions HardlyDivided() {
  SolveOptions options;
  options.w_min = 1e-2;
  options.a_min = 1e-2;
  return options;
}

struct Deviations {
  double before = 0;  // RMS, from what is known
  double after = 0;
  double told = 0;  // of the variances after
};

/// On the first patch of a box, `irradiance` of the place in it with noise of this standard deviation.
Deviations Smooth(const std::function<double(double u, double v)>& irradiance, double noise) {
  SolvedScene solved(testing::FurnaceBox(0.5), HardlyDivided());
  const Gatherer gatherer(solved.hierarchy, solved.solution.light, solved.solution.links, solved.visibility,
                          GatherOptions());
  OutputMesh mesh(solved.hierarchy, gatherer, solved.solution.links);
  for (int level = 0; level < 5; ++level) {
    const std::size_t count = mesh.cut().size();
    for (std::size_t k = 0; k < count; ++k) {
      if (solved.hierarchy[mesh.cut()[k]].patch == 0) {
        mesh.Divide(k);
      }
    }
  }
  mesh.Gather({}, OutputMesh::Source::kSolution);
  const Polygon shape = solved.hierarchy.Shape(0);
  const Vec3 along = shape[1] - shape[0];
  const Vec3 across = shape[3] - shape[0];
  const auto known = [&](const Vec3& x) {
    return irradiance((x - shape[0]).dot(along) / along.squaredNorm(),
                      (x - shape[0]).dot(across) / across.squaredNorm());
  };
  std::mt19937 random(3);
  std::normal_distribution<double> normal(0, noise);
  std::set<Index> vertices;
  Deviations deviations;
  for (std::size_t k = 0; k < mesh.cut().size(); ++k) {
    const Index e = mesh.cut()[k];
    if (solved.hierarchy[e].patch == 0) {
      OutputMesh::Sample sample = mesh.AtCentre(e);
      sample.irradiance = Rgb::Constant(known(ElementCentre(solved.hierarchy.Shape(e))) + normal(random));
      sample.variance = 3 * noise * noise;
      mesh.SetAtCentre(e, sample);
      vertices.insert(mesh.loops()[k].begin(), mesh.loops()[k].end());
    }
  }
  const auto square_at = [&](Index vertex) {
    return std::pow(mesh.AtVertex(vertex).irradiance[0] - known(solved.hierarchy.Point(vertex)), 2);
  };
  for (const Index vertex : vertices) {
    OutputMesh::Sample sample = mesh.AtVertex(vertex);
    sample.irradiance = Rgb::Constant(known(solved.hierarchy.Point(vertex)) + normal(random));
    sample.variance = 3 * noise * noise;
    mesh.SetAtVertex(vertex, sample);
    deviations.before += square_at(vertex);
  }
  SmoothNoise(mesh);
  for (const Index vertex : vertices) {
    deviations.after += square_at(vertex);
    deviations.told += mesh.AtVertex(vertex).variance / 3;
  }
  const auto count = static_cast<double>(vertices.size());
  return {std::sqrt(deviations.before / count), std::sqrt(deviations.after / count),
          std::sqrt(deviations.told / count)};
}

TEST(SmoothNoise, TakesHalfOfTheNoiseAwayWhereIrradianceIsSmoothAndSaysHowMuchIsLeft) {
  const Deviations deviations =
      Smooth([](double u, double v) { return 1 + 0.5 * u - 0.3 * v + 0.2 * u * v; }, 0.02);
  EXPECT_NEAR(deviations.before, 0.02, 0.001);
  EXPECT_LT(deviations.after, 0.5 * deviations.before);
  EXPECT_NEAR(deviations.told / deviations.after, 1, 0.3);
}

TEST(SmoothNoise, LeavesAShadowsEdgeThatStandsOutOfTheNoise) {
  const Deviations deviations = Smooth([](double u, double) { return u < 0.4 ? 1.0 : 0.2; }, 0.02);
  EXPECT_LT(deviations.after, 1.1 * deviations.before);
}

TEST(SmoothNoise, MovesNothingThatHasNoNoise) {
  const Deviations deviations = Smooth([](double u, double v) { return 1 + std::sin(9 * u) * v; }, 0);
  EXPECT_EQ(deviations.after, 0);
}

}  // namespace
}  // namespace radbake
