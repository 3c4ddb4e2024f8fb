#include "solver/solve/solver.h"

#include <oneapi/tbb/parallel_for.h>

#include <chrono>
#include <cmath>

#include "solver/refine/adaptive.h"
#include "solver/refine/hierarchical.h"
#include "solver/refine/linker.h"
#include "solver/refine/matrix.h"
#include "solver/refine/two_level.h"
#include "solver/solve/krylov.h"
#include "solver/solve/radiosity_operator.h"
#include "solver/transport/node_transport.h"
#include "solver/transport/sampling.h"

namespace radbake {
namespace {

// Multigridding: the threshold of the first pass, and its fall from pass to pass.
constexpr double kFirstThreshold = 0.05;
constexpr double kThresholdFall = 4;
// Two levels: areas of patches and of elements at first, in those of the smallest elements.
constexpr double kPatch = 64;
constexpr double kElement = 4;

/// Luminous power that the surfaces keep: all that is emitted, in a closed room; what of the sky and the sun
/// comes in, in any.
double AbsorbedPower(const Hierarchy& hierarchy, const Light& light) {
  double power = 0;
  for (Index root = 0; root < hierarchy.surface_root_count(); ++root) {
    power +=
        hierarchy[root].area * Luminance((1 - hierarchy.PatchOf(root).reflectance) * light.irradiance[root]);
  }
  return power;
}

/// What the links would bring if nothing were in between, as far as it is kept.
double UnoccludedPower(const Hierarchy& hierarchy, const Links& links, const Light& light) {
  double power = 0;
  for (const Link& link : links.all()) {
    const Rgb shot = link.shooter == link.receiver
                         ? light.cluster_radiosity[link.shooter - kFirstCluster].mean
                         : light.Shooting(hierarchy, link.shooter, hierarchy.Centre(link.receiver));
    power += hierarchy.Area(link.receiver) * static_cast<double>(link.form_factor) * Luminance(shot);
  }
  return power;
}

class Solver {
 public:
  Solver(Hierarchy& hierarchy, const Visibility& visibility, const SolveOptions& options)
      : hierarchy_(hierarchy),
        visibility_(visibility),
        options_(options),
        linker_(hierarchy, visibility, options.visibility_rays, options.direct_rays, options.basis) {
    solution_.light.basis = Basis(options.basis);
    linker_.TellOfBytes([this](std::size_t bytes) { HoldElements(bytes); });
  }

  Solution Run() {
    solution_.light.openness = LookAround(hierarchy_, visibility_);
    linker_.LinkRoots();
    Extend();
    const double a_min = options_.a_min * hierarchy_.patches().area;
    switch (options_.refinement) {
      case Refinement::kMatrix:
        Refine(MatrixOracle(a_min));
        Iterate(options_.tolerance);
        break;
      case Refinement::kTwoLevel:
        RunTwoLevel(a_min);
        break;
      case Refinement::kHierarchical:
        Refine(HierarchicalOracle(a_min, options_.f_max));
        Iterate(options_.tolerance);
        break;
      case Refinement::kAdaptive:
        RunAdaptive(a_min);
        break;
    }
    solution_.links = linker_.TakeLinks();
    return std::move(solution_);
  }

 private:
  void RunAdaptive(double a_min) {
    double threshold = kFirstThreshold;
    Iterate(threshold);
    while (!solution_.stopped && threshold > options_.w_min) {
      threshold = std::max(options_.w_min, threshold / kThresholdFall);
      ++now_.pass;
      const double w_min = threshold * Power();
      if (options_.oracle) {
        Refine(*options_.oracle(solution_.light, a_min, w_min));
      } else {
        Refine(AdaptiveOracle(solution_.light, a_min, w_min));
      }
      // The next pass changes more than a fine solution of this one would.
      Iterate(threshold > options_.w_min ? std::max(options_.tolerance, 0.01) : options_.tolerance);
    }
  }

  /// What thresholds are shares of. Where no light has been found, they are of what may yet be: of nothing,
  /// refinement would not end.
  double Power() const {
    const double absorbed = AbsorbedPower(hierarchy_, solution_.light);
    return absorbed > 0 ? absorbed : UnoccludedPower(hierarchy_, linker_.links(), solution_.light);
  }

  void RunTwoLevel(double a_min) {
    const TwoLevelAreas areas{.patch = kPatch * a_min, .element = kElement * a_min};
    Refine(TwoLevelOracle(areas, {}));
    for (;;) {
      IterateOnPatches(areas.patch);
      const std::vector<Index> steep = SteepElements(hierarchy_, solution_.light, options_.gradient, a_min);
      if (solution_.stopped || steep.empty()) {
        break;
      }
      ++now_.pass;
      Refine(TwoLevelOracle(areas, steep));
    }
  }

  void Refine(const Oracle& oracle) {
    linker_.Refine(oracle, [this] { return Stop(); });
    Extend();
  }

  void Extend() {
    constexpr int kPoints = 128;
    const std::size_t known = solution_.light.open.size();
    solution_.light.Extend(hierarchy_);
    tbb::parallel_for(known, hierarchy_.size(), [&](std::size_t e) {
      const auto element = static_cast<Index>(e);
      if (!hierarchy_.IsSky(element)) {
        solution_.light.open[e] = visibility_.OpenShare(hierarchy_.Shape(element), Hash(e), kPoints);
      }
    });
    solution_.light.PullOpen(hierarchy_);
  }

  void Iterate(double tolerance) {
    HoldElements(linker_.BytesOfElements() + linker_.links().Bytes() +
                 Rows::BytesNeeded(hierarchy_, linker_.links(), solution_.light));
    const Rows rows(hierarchy_, linker_.links(), solution_.light);
    Count(rows);
    const Couplings couplings(hierarchy_, visibility_, linker_.links(), solution_.light);
    RadiosityOperator radiosity_operator(hierarchy_, linker_.links(), rows, couplings, solution_.light);
    Iterate(radiosity_operator, tolerance);
  }

  /// The patches' radiosities first, then the elements' from those. Patches with polynomials are what their
  /// elements pull up to: all are solved at once then.
  void IterateOnPatches(double patch_area) {
    if (options_.basis != BasisOrder::kConstant) {
      Iterate(options_.tolerance);
      return;
    }
    HoldElements(linker_.BytesOfElements() + linker_.links().Bytes() +
                 Rows::BytesNeeded(hierarchy_, linker_.links(), solution_.light));
    const Rows elements(hierarchy_, linker_.links(), solution_.light);
    Count(elements);
    const Rows patches(hierarchy_, elements, PatchLevel(hierarchy_, patch_area));
    const Couplings couplings(hierarchy_, visibility_, linker_.links(), solution_.light);
    RadiosityOperator on_patches(hierarchy_, linker_.links(), patches, couplings, solution_.light);
    Iterate(on_patches, options_.tolerance);
    const RadiosityOperator on_elements(hierarchy_, linker_.links(), elements, couplings, solution_.light);
    on_elements.Store(on_elements.Gather(on_elements.Radiosity(solution_.light)), solution_.light);
  }

  /// What is there and what the iteration will need.
  void Count(const Rows& rows) {
    const std::size_t count = solution_.light.basis.count();
    solution_.bytes = RadiosityOperator::BytesNeeded(hierarchy_, linker_.links(), rows, count);
    solution_.bytes.elements += BytesOfIteration(count * rows.leaves().size()) + hierarchy_.Bytes() +
                                solution_.light.Bytes() + linker_.BytesOfElements();
    solution_.bytes.links +=
        linker_.links().Bytes() + rows.Bytes() + Couplings::BytesNeeded(linker_.links(), count);
    if (options_.hold) {
      options_.hold(solution_.bytes.elements + solution_.bytes.links);
    }
  }

  /// Tells of those bytes, and of the hierarchy and its light, for elements that are too young for it too.
  void HoldElements(std::size_t bytes) const {
    if (options_.hold) {
      const std::size_t lit = std::max<std::size_t>(1, solution_.light.open.size());
      options_.hold(bytes + hierarchy_.Bytes() +
                    solution_.light.Bytes() / lit * std::max(lit, hierarchy_.size()));
    }
  }

  void Iterate(RadiosityOperator& radiosity_operator, double tolerance) {
    Converge(radiosity_operator, tolerance);
    if (!solution_.stopped && radiosity_operator.Grows(solution_.light)) {
      const std::size_t before = now_.sweeps;
      radiosity_operator.Bound();
      Converge(radiosity_operator, tolerance);
      now_.sweeps += before;
    }
    Note();
    solution_.iterations.push_back(now_);
  }

  void Converge(const RadiosityOperator& radiosity_operator, double tolerance) {
    const auto note = [this](const Convergence& convergence) {
      now_.sweeps = convergence.applications;
      now_.residual = convergence.residual;
    };
    const IterationOptions options{.tolerance = tolerance, .stop = [&](const Convergence& convergence) {
                                     note(convergence);
                                     return Stop();
                                   }};
    note(options_.iteration == IterationMethod::kKrylov
             ? IterateByKrylov(radiosity_operator, options, solution_.light)
             : IterateBySweeps(radiosity_operator, options, solution_.light));
  }

  void Note() {
    now_.elements = hierarchy_.size();
    now_.links = linker_.links().size();
    now_.factors = linker_.measured();
    now_.rays = visibility_.Counted().rays;
    now_.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

  bool Stop() {
    Note();
    solution_.stopped = solution_.stopped || (options_.stop && options_.stop(now_));
    return solution_.stopped;
  }

  Hierarchy& hierarchy_;
  const Visibility& visibility_;
  const SolveOptions& options_;
  Linker linker_;
  Solution solution_;
  Iteration now_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace

Solution Solve(Hierarchy& hierarchy, const Visibility& visibility, const SolveOptions& options) {
  return Solver(hierarchy, visibility, options).Run();
}

}  // namespace radbake
