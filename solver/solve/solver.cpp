#include "solver/solve/solver.h"

#include <oneapi/tbb/parallel_for.h>

#include <chrono>
#include <cmath>

#include "solver/refine/adaptive.h"
#include "solver/refine/hierarchical.h"
#include "solver/refine/linker.h"
#include "solver/solve/radiosity_operator.h"
#include "solver/transport/sampling.h"

namespace radbake {
namespace {

// Multigridding: the threshold of the first pass, and its fall from pass to pass.
constexpr double kFirstThreshold = 0.05;
constexpr double kThresholdFall = 4;
constexpr std::size_t kMaxSweeps = 100'000;

class Solver {
 public:
  Solver(Hierarchy& hierarchy, const Visibility& visibility, const SolveOptions& options)
      : hierarchy_(hierarchy),
        visibility_(visibility),
        options_(options),
        linker_(hierarchy, visibility, options.visibility_rays) {}

  Solution Run() {
    linker_.LinkRoots();
    Extend();
    const double a_min = options_.a_min * hierarchy_.patches().area;
    if (options_.refinement == Refinement::kHierarchical) {
      Refine(HierarchicalOracle(a_min, options_.f_max));
      Iterate(options_.tolerance);
    } else {
      double threshold = kFirstThreshold;
      Iterate(threshold);
      while (!solution_.stopped && threshold > options_.w_min) {
        threshold = std::max(options_.w_min, threshold / kThresholdFall);
        ++now_.pass;
        Refine(AdaptiveOracle(solution_.light, a_min, threshold));
        // The next pass changes more than a fine solution of this one would.
        Iterate(threshold > options_.w_min ? std::max(options_.tolerance, 0.01) : options_.tolerance);
      }
    }
    solution_.links = linker_.links();
    return std::move(solution_);
  }

 private:
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
      solution_.light.open[e] = visibility_.OpenShare(hierarchy_.Shape(element), Hash(e), kPoints);
    });
    for (std::size_t e = hierarchy_.size(); e-- > 0;) {
      const Element& element = hierarchy_[static_cast<Index>(e)];
      if (!element.IsLeaf()) {
        double open_area = 0;
        double area = 0;
        for (Index child = element.first_child; child < element.first_child + 4; ++child) {
          open_area += hierarchy_[child].area * solution_.light.open[child];
          area += hierarchy_[child].area;
        }
        solution_.light.open[e] = open_area / area;
      }
    }
  }

  /// Sweeps until what is left of the geometric series of residuals is below the tolerance.
  void Iterate(double tolerance) {
    now_.sweeps = 0;
    double previous = 0;
    const Rows rows(hierarchy_, linker_.links(), solution_.light);
    for (; now_.sweeps < kMaxSweeps; ++now_.sweeps) {
      now_.residual = ApplyRadiosityOperator(hierarchy_, rows, solution_.light);
      const double ratio = previous > 0 ? now_.residual / previous : 1;
      previous = now_.residual;
      // The first sweeps spread light that the later ones only damp: their ratio says nothing yet.
      constexpr std::size_t kFirstSweeps = 3;
      if (now_.residual == 0 ||
          (now_.sweeps >= kFirstSweeps && ratio < 1 && now_.residual * ratio / (1 - ratio) < tolerance)) {
        break;
      }
      if (Stop()) {
        break;
      }
    }
    ++now_.sweeps;
    Note();
    solution_.iterations.push_back(now_);
  }

  void Note() {
    now_.elements = hierarchy_.size();
    now_.links = linker_.links().size();
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
