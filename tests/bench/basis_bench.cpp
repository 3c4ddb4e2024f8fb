// What the order of the basis is worth: the error that a solution leaves by itself, read without the final
// gather, and the one after it, at as many links and for as much time.
#include <array>
#include <map>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "solver/gltf/document.h"
#include "tests/bench/bench.h"
#include "tests/bench/solved.h"

namespace radbake::bench {
namespace {

constexpr std::array kNames = {"constant", "linear", "quadratic"};
constexpr std::array kWMin = {4e-4, 1e-4, 2.5e-5};

/// One of scenes/, or "empty-box": the Cornell box without its blocks, where nothing is between anything.
Patches PatchesOf(const std::string& name) {
  const bool empty = name == "empty-box";
  const std::string file = empty ? "cornell-box" : name;
  Scene scene = gltf::Document(gltf::ReadSource(RADBAKE_SOURCE_DIR "/scenes/" + file + ".glb")).scene();
  if (empty) {
    std::erase_if(scene.surfaces,
                  [](const Surface& surface) { return surface.name.find("block") != std::string::npos; });
  }
  return CutIntoPatches(scene);
}

SolveOptions Asking(BasisOrder order, double w_min) {
  SolveOptions options;
  options.a_min = 2e-6;
  options.basis = order;
  options.w_min = w_min;
  return options;
}

/// Of constants, ten times finer, gathered with many rays.
const std::vector<Rgb>& Reference(const std::string& scene, const Patches& patches) {
  constexpr double kFine = 1e-5;
  static std::map<std::string, std::vector<Rgb>> known;
  auto& reference = known[scene];
  if (reference.empty()) {
    const Solved solved(patches, Asking(BasisOrder::kConstant, kFine));
    reference = ReadAt(solved, {.rays = 2048, .negligible = 1e-4}).gathered;
  }
  return reference;
}

struct Errors {
  double links = 0;
  double solution = 0;
};

/// Counters: `leaves`, `links`, and the RMS errors in percent of the solution read as it is and gathered
/// anew. A higher order must do better than constants by itself, with no more links.
void BenchBasis(benchmark::State& state, const std::string& scene, BasisOrder order, double w_min) {
  const Patches patches = PatchesOf(scene);
  std::unique_ptr<Solved> solved;
  while (state.KeepRunning()) {
    solved = std::make_unique<Solved>(patches, Asking(order, w_min));
  }
  const std::vector<Rgb>& reference = Reference(scene, patches);
  const Read read = ReadAt(*solved, {.rays = 512, .negligible = 1e-4});
  double leaves = 0;
  for (Index e = 0; e < solved->hierarchy.size(); ++e) {
    leaves += solved->hierarchy[e].IsLeaf() ? 1 : 0;
  }
  const Errors errors{.links = static_cast<double>(solved->solution.links.size()),
                      .solution = Difference(read.solution, reference)};
  state.counters["leaves"] = leaves;
  state.counters["links"] = errors.links;
  state.counters["solution%"] = 100 * errors.solution;
  state.counters["gathered%"] = 100 * Difference(read.gathered, reference);
  static std::map<std::pair<std::string, double>, Errors> constants;
  if (order == BasisOrder::kConstant) {
    constants[{scene, w_min}] = errors;
  } else if (const auto known = constants.find({scene, w_min});
             known != constants.end() &&
             !(errors.solution < known->second.solution && errors.links <= known->second.links)) {
    Fail(state, "constants do better");
  }
}

}  // namespace

void RegisterBases() {
  for (const char* scene : {"empty-box", "cornell-box", "two-rooms"}) {
    for (const double w_min : kWMin) {
      for (std::size_t order = 0; order < kNames.size(); ++order) {
        std::ostringstream name;
        name << "Basis/" << scene << "/w_min:" << w_min << "/" << kNames[order];
        benchmark::RegisterBenchmark(name.str().c_str(),
                                     [scene, order, w_min](benchmark::State& state) {
                                       BenchBasis(state, scene, static_cast<BasisOrder>(order), w_min);
                                     })
            ->Unit(benchmark::kMillisecond)
            ->MeasureProcessCPUTime();
      }
    }
  }
}

}  // namespace radbake::bench
