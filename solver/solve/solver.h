/// The solve: link, iterate, refine, again (Hanrahan 1991: SolveHR and SolveAHR).
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "solver/hierarchy/light.h"
#include "solver/refine/oracle.h"
#include "solver/solve/solution.h"
#include "solver/transport/visibility.h"

namespace radbake {

enum class Refinement { kMatrix, kTwoLevel, kHierarchical, kAdaptive };
enum class IterationMethod { kKrylov, kSweeps };

struct SolveOptions {
  Refinement refinement = Refinement::kAdaptive;
  /// Elements below this share of the scene's area are not divided; kMatrix: the largest leaves are as large.
  double a_min = 1e-5;
  /// kTwoLevel: neighbours may differ by this share of the RMS irradiance.
  double gradient = 0.1;
  double f_max = 0.05;  ///< kHierarchical
  double w_min = 1e-5;  ///< kAdaptive: of the last pass; share of the absorbed power
  /// kAdaptive: another oracle than AdaptiveOracle, to be measured against it; as its constructor.
  std::function<std::unique_ptr<Oracle>(const Light& light, double a_min, double w_min)> oracle;
  BasisOrder basis = BasisOrder::kConstant;
  IterationMethod iteration = IterationMethod::kKrylov;
  double tolerance = 1e-4;   ///< largest relative error of the radiosity that the iteration may leave
  int visibility_rays = 32;  ///< see Linker
  int direct_rays = 256;     ///< see Linker
  /// Called now and then while links are refined, and between sweeps or a few applications of the operator in
  /// an iteration; true ends the solve with what it has.
  std::function<bool(const Iteration&)> stop;
  /// Told of all that the solve holds, the hierarchy too.
  Hold hold;
};

struct Solution {
  Light light;
  Links links;
  std::vector<Iteration> iterations;
  SolveBytes bytes;
  bool stopped = false;  ///< by `stop`
};

/// Divides `hierarchy` and solves for the light on it. The same on any number of threads, as long as `stop`
/// is.
Solution Solve(Hierarchy& hierarchy, const Visibility& visibility, const SolveOptions& options);

}  // namespace radbake
