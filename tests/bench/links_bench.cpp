// The claim of hierarchical radiosity (Hanrahan, Salzman, Aupperle 1991, section 3.4): links grow linearly
// with elements, not with their square. The Cornell box under the static oracle, F_max fixed, A_min falling.
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <sstream>
#include <vector>

#include "solver/refine/hierarchical.h"
#include "solver/refine/linker.h"
#include "tests/bench/bench.h"

namespace radbake::bench {
namespace {

constexpr double kFMax = 0.05;
constexpr std::array kAMin = {1e-3, 2.5e-4, 6.25e-5, 1.5625e-5, 3.90625e-6};
constexpr double kLargestShare = 0.02;
constexpr double kShareFrom = 10'000;  // leaves
constexpr double kLargestExponent = 1.05;
constexpr double kLargestSpread = 1.25;

struct Size {
  double elements = 0;  ///< all nodes
  double leaves = 0;
  double links = 0;
  /// Of the matrix from every leaf to every leaf, which holds no fewer entries than any other flat one.
  double Share() const { return links / (leaves * leaves); }
};

Size Link(const Patches& patches, double a_min) {
  Hierarchy hierarchy(patches);
  const Visibility visibility(patches);
  // Visibility decides about no link of the static oracle, so few rays do.
  constexpr int kRays = 2;
  Linker linker(hierarchy, visibility, kRays, kRays);
  linker.LinkRoots();
  linker.Refine(HierarchicalOracle(a_min * patches.area, kFMax), {});
  Size size{.elements = static_cast<double>(hierarchy.size()),
            .links = static_cast<double>(linker.links().size())};
  for (Index e = 0; e < hierarchy.size(); ++e) {
    size.leaves += hierarchy[e].IsLeaf() ? 1 : 0;
  }
  return size;
}

/// The newest run's, by A_min.
std::map<double, Size>& Known() {
  static std::map<double, Size> known;
  return known;
}

void BenchLinks(benchmark::State& state, double a_min) {
  const Patches patches = LoadPatches("cornell-box");
  Size size;
  while (state.KeepRunning()) {
    size = Link(patches, a_min);
  }
  Known()[a_min] = size;
  state.counters["elements"] = size.elements;
  state.counters["leaves"] = size.leaves;
  state.counters["links"] = size.links;
  state.counters["per_leaf"] = size.links / size.leaves;
  state.counters["matrix%"] = 100 * size.Share();
  if (size.leaves >= kShareFrom && size.Share() > kLargestShare) {
    Fail(state, "the links are " + std::to_string(100 * size.Share()) + " % of the full matrix");
  }
}

/// Counters: `exponent`, the least-squares slope of log links over log leaves, which is below 1 where links
/// are linear with a constant (the pairs that F_max divides at any A_min); `added_least`, `added_most`: links
/// that a leaf adds from one A_min to the next, which are the same if links are linear.
void BenchGrowth(benchmark::State& state) {
  double exponent = 0;
  double least = INFINITY;
  double most = 0;
  while (state.KeepRunning()) {
    std::vector<Size> sizes;
    for (const double a_min : kAMin) {
      if (!Known().contains(a_min)) {
        Known()[a_min] = Link(LoadPatches("cornell-box"), a_min);
      }
      sizes.push_back(Known()[a_min]);
    }
    Eigen::ArrayXd x(sizes.size());
    Eigen::ArrayXd y(sizes.size());
    for (std::size_t k = 0; k < sizes.size(); ++k) {
      x[static_cast<Eigen::Index>(k)] = std::log(sizes[k].leaves);
      y[static_cast<Eigen::Index>(k)] = std::log(sizes[k].links);
      if (k > 0) {
        const double added = (sizes[k].links - sizes[k - 1].links) / (sizes[k].leaves - sizes[k - 1].leaves);
        least = std::min(least, added);
        most = std::max(most, added);
      }
    }
    exponent = ((x - x.mean()) * y).sum() / (x - x.mean()).square().sum();
  }
  state.counters["exponent"] = exponent;
  state.counters["added_least"] = least;
  state.counters["added_most"] = most;
  if (!(exponent <= kLargestExponent)) {
    Fail(state, "the links grow with the leaves to the power of " + std::to_string(exponent));
  } else if (!(most <= kLargestSpread * least)) {
    Fail(state, "a leaf adds from " + std::to_string(least) + " to " + std::to_string(most) + " links");
  }
}

}  // namespace

void RegisterLinks() {
  for (const double a_min : kAMin) {
    std::ostringstream name;
    name << "Links/cornell-box/a_min:" << a_min;
    benchmark::RegisterBenchmark(name.str().c_str(),
                                 [a_min](benchmark::State& state) { BenchLinks(state, a_min); })
        ->UseRealTime()
        ->Unit(benchmark::kMillisecond);
  }
  benchmark::RegisterBenchmark("Links/cornell-box/growth", BenchGrowth)
      ->UseRealTime()
      ->Iterations(1)
      ->Unit(benchmark::kMillisecond);
}

}  // namespace radbake::bench
