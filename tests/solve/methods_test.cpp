/// All methods solve the same equation: on scenes with known answers, and on scenes that they must agree on.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "solver/gltf/document.h"
#include "solver/solve/energy.h"
#include "tests/solve/solved_scene_test.h"
#include "tests/test_scenes.h"

namespace radbake {
namespace {

using testing::SolvedScene;

struct Setting {
  const char* name;
  Refinement refinement;
  double a_min;
  double f_max = 0.05;
  double w_min = 2e-4;
};

SolveOptions OptionsOf(const Setting& setting) {
  SolveOptions options;
  options.refinement = setting.refinement;
  options.a_min = setting.a_min;
  options.f_max = setting.f_max;
  options.w_min = setting.w_min;
  options.gradient = 0.2;
  options.tolerance = 1e-5;
  return options;
}

constexpr std::array kCoarse = {
    Setting{.name = "matrix", .refinement = Refinement::kMatrix, .a_min = 1.2e-2},
    Setting{.name = "two-level", .refinement = Refinement::kTwoLevel, .a_min = 1e-3},
    Setting{.name = "hierarchical", .refinement = Refinement::kHierarchical, .a_min = 2e-3},
    Setting{.name = "adaptive", .refinement = Refinement::kAdaptive, .a_min = 2e-3, .w_min = 1e-3}};

constexpr std::array kFine = {
    Setting{.name = "matrix", .refinement = Refinement::kMatrix, .a_min = 4e-3},
    Setting{.name = "two-level", .refinement = Refinement::kTwoLevel, .a_min = 1e-4},
    Setting{.name = "hierarchical", .refinement = Refinement::kHierarchical, .a_min = 5e-4, .f_max = 0.008}};
constexpr Setting kReference{
    .name = "adaptive", .refinement = Refinement::kAdaptive, .a_min = 1e-5, .w_min = 5e-5};

Scene Load(const std::string& name) {
  return gltf::Document(gltf::ReadSource(RADBAKE_SOURCE_DIR "/scenes/" + name)).scene();
}

TEST(AccuracyOfMethods, FurnacesGlowEvenlyAtEveryVertex) {
  for (const double reflectance : {0.5, 0.99}) {
    for (const Scene& scene : {testing::FurnaceBox(reflectance), testing::FurnaceSphere(reflectance, 1)}) {
      for (const Setting& setting : kCoarse) {
        SolvedScene solved(scene, OptionsOf(setting));
        MeshOptions mesh;
        mesh.start_area = 1e-2;
        const double expected = std::numbers::pi / (1 - reflectance);
        double worst = 0;
        for (const BakedSurface& surface : solved.Output(mesh).surfaces) {
          for (const BakedVertex& vertex : surface.front.vertices) {
            worst = std::max(worst, (vertex.irradiance.cast<double>() / expected - 1).abs().maxCoeff());
          }
        }
        EXPECT_LT(worst, 1e-3) << setting.name << ", " << scene.surfaces.size() << " surfaces, reflectance "
                               << reflectance;
      }
    }
  }
}

/// The relative RMS difference of the patches' mean irradiance.
double Difference(const SolvedScene& solved, const SolvedScene& reference) {
  double difference = 0;
  double square = 0;
  for (Index root = 0; root < solved.hierarchy.root_count(); ++root) {
    const Rgb& known = reference.solution.light.irradiance[root];
    difference +=
        solved.hierarchy[root].area * (solved.solution.light.irradiance[root] - known).square().sum();
    square += solved.hierarchy[root].area * known.square().sum();
  }
  return std::sqrt(difference / square);
}

// The suite whose name begins with Accuracy takes too long under a sanitizer.
TEST(AccuracyOfMethods, AllAgreeAndKeepTheirEnergy) {
  for (const char* name : {"cornell-box.glb", "two-rooms.glb"}) {
    const Scene scene = Load(name);
    const SolvedScene reference(scene, OptionsOf(kReference));
    for (const Setting& setting : kFine) {
      SolveOptions options = OptionsOf(setting);
      options.visibility_rays = 8;
      const SolvedScene solved(scene, options);
      EXPECT_LT(Difference(solved, reference), 0.01) << setting.name << " in " << name;
      const EnergyBalance balance = BalanceEnergy(solved.hierarchy, solved.solution.light, solved.visibility);
      EXPECT_LT(balance.imbalance, 0.005) << setting.name << " in " << name;
    }
  }
}

}  // namespace
}  // namespace radbake
