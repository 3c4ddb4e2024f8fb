#include "solver/radbake.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <new>
#include <sstream>
#include <utility>

#include "solver/bake/emit.h"
#include "solver/bake/mesh_refinement.h"
#include "solver/bake/output_mesh.h"
#include "solver/check/check.h"
#include "solver/hierarchy/hierarchy.h"
#include "solver/memory.h"
#include "solver/scene/patches.h"
#include "solver/solve/energy.h"
#include "solver/solve/solver.h"
#include "solver/watch.h"

namespace radbake {
namespace {

// Where each phase ends in the whole bake, as the progress shows it.
constexpr double kImported = 0.02;
constexpr double kSolved = 0.4;
constexpr double kGathered = 0.85;
constexpr double kExported = 0.9;

// Shares of a time budget after which the first solve, dividing the output, and its check stop.
constexpr double kSolveShare = 0.4;
constexpr double kGatherShare = 0.75;
constexpr double kGatherShareUnchecked = 0.92;
constexpr double kCheckShare = 0.95;

/// By Method: how its smallest elements' share of the scene's area follows from `error`. Fitted so that what
/// the elements' constants leave in the final irradiance is a small part of the target. kAdaptive: it only
/// ends what would not; W_min must decide, down to the narrow gap between a lamp and its ceiling.
/// `direct_rays`: kHierarchical leaves lamps that are seen small on links from all of a floor.
struct ByMethod {
  Refinement refinement;
  double a_min_per_error;
  int direct_rays;
};
constexpr std::array kByMethod{
    ByMethod{Refinement::kMatrix, 0.05, 32}, ByMethod{Refinement::kTwoLevel, 0.005, 256},
    ByMethod{Refinement::kHierarchical, 0.02, 1024}, ByMethod{Refinement::kAdaptive, 1e-4, 256}};

/// Of the emitted power: beyond it a bake warns.
constexpr double kMostImbalance = 0.02;

SolveOptions OptionsOf(const Parameters& parameters, bool by_rays) {
  SolveOptions options;
  const ByMethod& by_method = kByMethod[static_cast<std::size_t>(parameters.method)];
  options.refinement = by_method.refinement;
  options.direct_rays = by_method.direct_rays;
  options.a_min =
      parameters.oracle.a_min.value_or(std::clamp(by_method.a_min_per_error * parameters.error, 1e-8, 1e-2));
  options.basis = *parameters.basis;
  options.gradient = std::clamp(5 * parameters.error, 0.02, 1.0);
  options.f_max = parameters.oracle.f_max.value_or(std::clamp(parameters.error, 1e-3, 0.5));
  // The solution's error falls slower than W_min; constants leave more of it, and lose energy at slits.
  const double finer = std::min(1.0, std::sqrt(parameters.error / 0.02));
  // Where the gather asks rays instead of links, their own error is seen after one more reflection alone.
  const double w_min_per_error = !by_rays && *parameters.basis == BasisOrder::kConstant ? 0.01 : 0.02;
  options.w_min =
      parameters.oracle.w_min.value_or(std::clamp(w_min_per_error * finer * parameters.error, 1e-8, 1e-2));
  options.tolerance = 0.02 * parameters.error;
  return options;
}

bool WantsClusters(const Parameters& parameters, std::size_t patches) {
  // Where the links between all pairs begin to cost more than the rest.
  constexpr std::size_t kMany = 400;
  return parameters.clustering == Clustering::kOn ||
         (parameters.clustering == Clustering::kAuto && patches > kMany);
}

/// Linear elements need the fewest links for their error, but not where patches below clusters are finer than
/// the light requires; the other methods are what their papers describe.
BasisOrder BasisOf(const Parameters& parameters, std::size_t patches) {
  const bool linear = parameters.method == Method::kAdaptive && !WantsClusters(parameters, patches);
  return parameters.basis.value_or(linear ? BasisOrder::kLinear : BasisOrder::kConstant);
}

/// Whether the final gather casts its rays around points instead of along links.
bool WantsRaysAround(const Parameters& parameters, std::size_t patches) {
  // Where links begin to know less than as many rays: a living room of 5,000 patches is better off with
  // links, a furnished one of 8,500 with rays.
  constexpr std::size_t kMany = 8000;
  return parameters.final_gather != FinalGather::kOff && patches > kMany &&
         WantsClusters(parameters, patches);
}

/// What thresholds that follow from `error` leave of it in the solution, as the final gather sees it: less
/// where the mesh becomes its own light. Measured over the scenes of the benchmark.
constexpr double kLeftBySolution = 0.55;
constexpr double kLeftByOwnLight = 0.4;

MeshOptions MeshOptionsOf(const Parameters& parameters, bool by_rays) {
  MeshOptions options;
  // Stairs along hard shadows show before they count.
  options.error = (by_rays ? 0.4 : 0.25) * parameters.error;
  // What is left of the rays' noise when it has been smoothed is less.
  options.noise = (by_rays ? 0.9 : 0.65) * parameters.error;
  options.start_area = std::clamp(0.05 * parameters.error, 1e-5, 1e-2);
  options.near_area = options.start_area / (by_rays ? 64 : 1);
  options.min_area = 1e-4 * options.start_area;
  return options;
}

GatherOptions GatherOptionsOf(const Parameters& parameters, bool by_rays) {
  GatherOptions options;
  options.rays = std::clamp(static_cast<int>(std::lround(2 / parameters.error)), 16, 4096);
  options.uneven = parameters.error;
  options.negligible = 0.08 * parameters.error;
  options.by_rays = by_rays;
  options.full_area = std::clamp(0.05 * parameters.error, 1e-5, 1e-2);
  return options;
}

/// All that a bake goes by.
struct Setting {
  const Parameters& parameters;
  const Scene& scene;
  const Patches& patches;
  const Visibility& visibility;
  Watch& watch;
  Phases& phases;
  MemoryBudget& memory;
};

/// What asking for one error gives.
struct Baking {
  double error = 0;  ///< asked for
  std::vector<Iteration> iterations;
  SolveBytes bytes;
  std::size_t most_bytes = 0;  ///< of memory, counted
  EnergyBalance energy;
  BakedScene output;
  double estimated_error = 0;
  MeshEnd end = MeshEnd::kError;
  bool solve_stopped = false;
  bool memory_bound = false;  ///< a finer one would have passed the limit

  bool stopped() const { return solve_stopped || end == MeshEnd::kStopped; }
};

/// Solves and gathers. What would not be done within these shares of the time budget stops, and is as good as
/// the time was. `beside`: bytes that are held meanwhile. Throws BeyondMemory.
Baking BakeTo(double error, double solve_share, double gather_share, const Setting& setting,
              std::size_t beside = 0) {
  const auto& [parameters, scene, patches, visibility, watch, phases, memory] = setting;
  Parameters asked = parameters;
  asked.error = error;
  const double part = parameters.error / error;
  Baking baking;
  baking.error = error;
  const bool by_rays = WantsRaysAround(asked, patches.surface_patches);
  Hierarchy hierarchy(patches, WantsClusters(asked, patches.surface_patches));
  SolveOptions solve_options = OptionsOf(asked, by_rays);
  solve_options.stop = [&](const Iteration& iteration) {
    watch.progress().iteration = iteration;
    // Each pass costs about as much as all before it.
    watch.Report("solve", kImported + part * (kSolved - kImported) *
                                          (1 - std::pow(0.7, static_cast<double>(iteration.pass))));
    return watch.Beyond(solve_share);
  };
  solve_options.hold = [&](std::size_t bytes) { memory.Check(beside + bytes); };
  const Solution solution = Solve(hierarchy, visibility, solve_options);
  phases.EndOfRays("solve", visibility.Counted().seconds);
  baking.energy = BalanceEnergy(hierarchy, solution.light, visibility);
  phases.EndOfRays("energy", visibility.Counted().seconds);

  const Gatherer gatherer(hierarchy, solution.light, solution.links, visibility,
                          GatherOptionsOf(asked, by_rays));
  const std::size_t solved = beside + solution.light.Bytes() + solution.links.Bytes() + gatherer.Bytes();
  OutputMesh mesh(hierarchy, gatherer, solution.links,
                  [&](std::size_t bytes) { memory.Check(solved + bytes); });
  MeshSummary gathered;
  if (parameters.final_gather == FinalGather::kOff) {
    gathered = TakeSolution(mesh);
  } else {
    MeshOptions mesh_options = MeshOptionsOf(asked, by_rays);
    mesh_options.stop = [&](double mesh_error, std::size_t /*vertices*/) {
      watch.progress().error = mesh_error;
      watch.Report("gather", kSolved + part * (kGathered - kSolved) *
                                           std::clamp(mesh_options.error / mesh_error, 0.0, 1.0));
      return watch.Beyond(gather_share);
    };
    gathered = RefineMesh(mesh, mesh_options);
  }
  baking.end = gathered.end;
  baking.output = Emit(hierarchy, mesh, scene.surfaces.size(), parameters.exposure);
  baking.estimated_error =
      std::hypot(gathered.error, gathered.noise, (by_rays ? kLeftByOwnLight : kLeftBySolution) * error);
  baking.iterations = solution.iterations;
  baking.bytes = solution.bytes;
  baking.solve_stopped = solution.stopped;
  baking.most_bytes = memory.TakeMost();
  phases.EndOfRays("gather", visibility.Counted().seconds);
  return baking;
}

/// The same, or to the next coarser error that the memory allows. Throws OutOfMemory if there is none.
Baking BakeInMemory(double error, double solve_share, double gather_share, const Setting& setting) {
  constexpr double kCoarsest = 0.5;
  constexpr double kCoarser = 2;
  for (double next = error;; next = std::min(kCoarsest, kCoarser * next)) {
    try {
      Baking baking = BakeTo(next, solve_share, gather_share, setting);
      baking.memory_bound = next > error;
      return baking;
    } catch (const BeyondMemory& beyond) {
      setting.phases.EndOfRays("solve", setting.visibility.Counted().seconds);
      if (next >= kCoarsest) {
        throw OutOfMemory(beyond.bytes, setting.memory.limit());
      }
    }
  }
}

std::string Percent(double share) {
  std::ostringstream text;
  text << 100 * share << " %";
  return text.str();
}

/// Says to what a bake was coarsened, and what the asked error would have needed.
std::string MemoryWarning(const Baking& baking, double asked, const MemoryBudget& memory) {
  // What was there before anything was divided stays; the rest grows about as the error falls.
  const double undivided =
      static_cast<double>(memory.base()) + static_cast<double>(baking.bytes.elements) *
                                               static_cast<double>(baking.iterations.front().elements) /
                                               static_cast<double>(baking.iterations.back().elements);
  const auto most = static_cast<double>(baking.most_bytes);
  const double needed = most + std::max(0.0, most - undivided) * (baking.error / asked - 1);
  return "an error of " + Percent(asked) + " would have needed about " +
         BytesInWords(std::max(static_cast<std::size_t>(needed), memory.limit())) + " of memory; baked to " +
         Percent(baking.error) + " within the limit of " + BytesInWords(memory.limit());
}

/// The error that is likely to take `seconds`, after one that took `last_seconds`.
double AffordableError(double last_error, double last_seconds, double seconds) {
  // Halving the error takes 2 to 4 times as long.
  constexpr double kExponent = 0.6;
  return last_error * std::pow(last_seconds / seconds, kExponent);
}

std::size_t BytesOfOutput(const BakedScene& scene) {
  std::size_t bytes = 0;
  for (const BakedSurface& surface : scene.surfaces) {
    for (const BakedMesh* side : {&surface.front, &surface.back}) {
      bytes += BytesOf(side->vertices) + BytesOf(side->triangles);
    }
  }
  return bytes;
}

/// The best that a time budget allows: a coarse baking that is soon done, or cut off, and finer ones as long
/// as they are likely to be done.
Baking BakeWithin(double budget, const Setting& setting) {
  constexpr double kCoarsest = 0.3;
  constexpr double kSafe = 0.6;   // of the time that is left, what is planned with
  constexpr double kWorth = 0.8;  // of the last error, what is worth another baking
  const Parameters& parameters = setting.parameters;
  const double gather_share = parameters.check > 0 ? kGatherShare : kGatherShareUnchecked;
  double begin = setting.watch.Seconds();
  Baking best = BakeInMemory(std::max(kCoarsest, parameters.error), kSolveShare, gather_share, setting);
  while (!best.stopped() && !best.memory_bound && best.end == MeshEnd::kError &&
         best.error > parameters.error) {
    const double now = setting.watch.Seconds();
    const double left = gather_share * budget - now;
    const double next =
        left > 0 ? std::max(parameters.error, AffordableError(best.error, now - begin, kSafe * left))
                 : best.error;
    if (next > kWorth * best.error && next > parameters.error) {
      best.solve_stopped = true;
      break;
    }
    begin = now;
    try {
      Baking finer = BakeTo(next, gather_share, gather_share, setting, BytesOfOutput(best.output));
      if (finer.stopped()) {
        best.solve_stopped = true;
      } else {
        best = std::move(finer);
      }
    } catch (const BeyondMemory&) {
      setting.phases.EndOfRays("solve", setting.visibility.Counted().seconds);
      best.memory_bound = true;
    }
  }
  return best;
}

std::size_t InputBytes(const gltf::Source& source) {
  std::size_t bytes = source.bytes.size();
  for (const auto& [uri, resource] : source.resources) {
    bytes += resource.size();
  }
  return bytes;
}

BakeResult BakeAll(const gltf::Source& source, const Parameters& asked, const ProgressCallback& callback,
                   const gltf::Limits& limits, std::size_t memory_limit) {
  Watch watch(asked, callback);
  BakeResult result;
  Statistics& statistics = result.statistics;
  Phases phases(watch, statistics);

  watch.Report("import", 0);
  gltf::Document document(source, limits);
  document.SetEnvironment(asked.environment);
  const Scene& scene = document.scene();
  const Patches patches = CutIntoPatches(scene);
  Parameters parameters = asked;
  parameters.basis = BasisOf(asked, patches.surface_patches);
  statistics.parameters = parameters;
  statistics.warnings = scene.warnings;
  statistics.scene.ignored = scene.ignored;
  statistics.scene.materials = scene.materials.size();
  statistics.scene.patches = patches.surface_patches;
  for (const Surface& surface : scene.surfaces) {
    statistics.scene.triangles += surface.triangles.size();
  }
  statistics.scene.lights = static_cast<std::size_t>(
      std::ranges::count_if(std::span(patches.patches).first(patches.surface_patches),
                            [](const Patch& patch) { return patch.emission.maxCoeff() > 0; }));
  statistics.scene.lights += scene.lights.size() + ((scene.environment > 0).any() ? 1U : 0U);
  phases.End("import");

  MemoryBudget memory(memory_limit, InputBytes(source), patches);
  if (memory.base() > memory_limit) {
    throw OutOfMemory(memory.base(), memory_limit);
  }
  statistics.memory_limit = memory_limit;

  watch.Report("solve", kImported);
  std::optional<Visibility> visibility(std::in_place, patches);
  const Setting setting{parameters, scene, patches, *visibility, watch, phases, memory};
  Baking baking = parameters.time_budget ? BakeWithin(*parameters.time_budget, setting)
                                         : BakeInMemory(parameters.error, 1, 1, setting);
  if (baking.memory_bound) {
    statistics.warnings.push_back(MemoryWarning(baking, parameters.error, memory));
  }
  phases.Finish();

  statistics.energy = baking.energy;
  if (!(baking.energy.imbalance <= kMostImbalance)) {
    statistics.warnings.push_back("the energy balance is open by " + Percent(baking.energy.imbalance) +
                                  ": the light is too uncertain at these settings");
  }
  statistics.iterations = std::move(baking.iterations);
  statistics.solve_bytes = baking.bytes;
  statistics.estimated_error = baking.estimated_error;
  statistics.stopped_by = baking.memory_bound                         ? StoppedBy::kLimit
                          : baking.stopped()                          ? StoppedBy::kTimeBudget
                          : baking.estimated_error > parameters.error ? StoppedBy::kLimit
                                                                      : StoppedBy::kError;
  statistics.rays = visibility->Counted().rays;
  for (const BakedSurface& surface : baking.output.surfaces) {
    for (const BakedMesh* side : {&surface.front, &surface.back}) {
      statistics.output.vertices += side->vertices.size();
      statistics.output.triangles += side->triangles.size();
    }
  }
  statistics.output.exposure = baking.output.exposure;

  watch.progress().error = statistics.estimated_error;
  watch.Report("export", kGathered);
  // What follows needs the room.
  visibility.reset();
  result.glb = document.Export(baking.output);
  baking.output = {};
  phases.End("export");

  watch.Report("check", kExported);
  if (parameters.check > 0 && !watch.Beyond(kCheckShare)) {
    CheckOptions check;
    check.probes = parameters.check;
    check.stop = [&] { return watch.Beyond(kCheckShare); };
    const CheckSummary summary = Check(scene, gltf::ReadIrradiance({result.glb, {}}), check);
    if (summary.probes > 0) {
      statistics.measured = summary;
    }
    phases.End("check");
  }
  watch.Report("check", 1);
  statistics.peak_bytes = PeakBytes();
  return result;
}

}  // namespace

BakeResult Bake(const gltf::Source& source, const Parameters& parameters, const ProgressCallback& callback,
                const gltf::Limits& limits, std::optional<std::size_t> memory_limit) {
  const std::size_t limit = memory_limit.value_or(FreeMemory());
  try {
    return BakeAll(source, parameters, callback, limits, limit);
  } catch (const std::bad_alloc&) {
    throw OutOfMemory(PeakBytes(), limit);
  }
}

}  // namespace radbake
