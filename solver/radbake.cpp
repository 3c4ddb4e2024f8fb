#include "solver/radbake.h"

#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <ctime>
#include <utility>

#include "solver/bake/emit.h"
#include "solver/bake/output_mesh.h"
#include "solver/check/check.h"
#include "solver/hierarchy/hierarchy.h"
#include "solver/scene/patches.h"
#include "solver/solve/energy.h"
#include "solver/solve/solver.h"

namespace radbake {
namespace {

using Clock = std::chrono::steady_clock;

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

std::size_t PeakBytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::size_t>(usage.ru_maxrss) * 1024;
}

/// Of all threads of the process, so far. Unlike the time on the wall it knows no other process.
double ProcessorSeconds() {
  return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

/// Tells the caller, keeps the clock, and decides when time is up.
class Watch {
 public:
  Watch(const Parameters& parameters, const ProgressCallback& callback)
      : budget_(parameters.time_budget), callback_(callback) {}

  double Seconds() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }

  /// Reports, but not more often than a few times a second within one phase. Throws Interrupted.
  void Report(std::string_view phase, double fraction) {
    progress_.seconds = Seconds();
    progress_.fraction = std::max(progress_.fraction, fraction);
    constexpr double kInterval = 0.1;
    if (callback_ &&
        (phase != progress_.phase || fraction >= 1 || progress_.seconds >= last_report_ + kInterval)) {
      progress_.phase = phase;
      last_report_ = progress_.seconds;
      if (callback_(progress_) == Continue::kStop) {
        throw Interrupted();
      }
    }
  }

  bool Beyond(double share) const { return budget_ && Seconds() > share * *budget_; }
  Progress& progress() { return progress_; }

  /// Seconds since the last call: the phase that just ended.
  double Lap() {
    const double now = Seconds();
    return now - std::exchange(lap_, now);
  }

 private:
  std::optional<double> budget_;
  const ProgressCallback& callback_;
  Progress progress_;
  Clock::time_point start_ = Clock::now();
  double last_report_ = -1;
  double lap_ = 0;
};

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
  const double w_min_per_error = by_rays ? 0.03 : *parameters.basis == BasisOrder::kConstant ? 0.01 : 0.02;
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

/// What thresholds that follow from `error` leave of it in the solution, as the final gather sees it.
/// Measured over the scenes of the benchmark.
constexpr double kLeftBySolution = 0.55;

MeshOptions MeshOptionsOf(const Parameters& parameters, bool by_rays) {
  MeshOptions options;
  options.error = 0.5 * parameters.error;
  options.noise = 0.7 * parameters.error;
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

/// Adds up where time goes, by phase.
class Phases {
 public:
  Phases(Watch& watch, Statistics& statistics) : watch_(watch), statistics_(statistics) {}

  /// What was done since the last end.
  void End(const char* name) { Sum(statistics_.seconds, name) += watch_.Lap(); }

  void EndOfRays(const char* name, double ray_seconds) {
    End(name);
    const double before = std::exchange(processor_seconds_, ProcessorSeconds());
    const double rays_before = std::exchange(statistics_.ray_seconds, ray_seconds);
    Sum(processor_, name) += processor_seconds_ - before;
    Sum(rays_, name) += ray_seconds - rays_before;
  }

  void Finish() {
    double all = 0;
    double all_rays = 0;
    for (const auto& [name, spent] : processor_) {
      statistics_.ray_shares.emplace_back(name, spent > 0 ? Sum(rays_, name) / spent : 0);
      all += spent;
      all_rays += Sum(rays_, name);
    }
    statistics_.ray_shares.emplace_back("all", all > 0 ? all_rays / all : 0);
  }

 private:
  using Sums = std::vector<std::pair<std::string, double>>;
  static double& Sum(Sums& sums, const std::string& name) {
    const auto found = std::ranges::find(sums, name, &Sums::value_type::first);
    return found != sums.end() ? found->second : sums.emplace_back(name, 0.0).second;
  }

  Watch& watch_;
  Statistics& statistics_;
  double processor_seconds_ = ProcessorSeconds();
  Sums processor_;
  Sums rays_;
};

/// What asking for one error gives.
struct Baking {
  Solution solution;
  EnergyBalance energy;
  BakedScene output;
  double estimated_error = 0;
  MeshEnd end = MeshEnd::kError;

  bool stopped() const { return solution.stopped || end == MeshEnd::kStopped; }
};

/// Solves and gathers. What would not be done within these shares of the time budget stops, and is as good as
/// the time was.
Baking BakeTo(double error, double solve_share, double gather_share, const Parameters& parameters,
              const Scene& scene, const Patches& patches, const Visibility& visibility, Watch& watch,
              Phases& phases) {
  Parameters asked = parameters;
  asked.error = error;
  const double part = parameters.error / error;
  Baking baking;
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
  baking.solution = Solve(hierarchy, visibility, solve_options);
  phases.EndOfRays("solve", visibility.Counted().seconds);
  baking.energy = BalanceEnergy(hierarchy, baking.solution.light, visibility);
  phases.EndOfRays("energy", visibility.Counted().seconds);

  const Gatherer gatherer(hierarchy, baking.solution.light, baking.solution.links, visibility,
                          GatherOptionsOf(asked, by_rays));
  OutputMesh mesh(hierarchy, gatherer, baking.solution.links);
  if (parameters.final_gather == FinalGather::kOff) {
    mesh.TakeSolution();
  } else {
    MeshOptions mesh_options = MeshOptionsOf(asked, by_rays);
    mesh_options.stop = [&](double mesh_error, std::size_t /*vertices*/) {
      watch.progress().error = mesh_error;
      watch.Report("gather", kSolved + part * (kGathered - kSolved) *
                                           std::clamp(mesh_options.error / mesh_error, 0.0, 1.0));
      return watch.Beyond(gather_share);
    };
    baking.end = mesh.Refine(mesh_options);
  }
  baking.output = Emit(hierarchy, mesh, scene.surfaces.size(), parameters.exposure);
  baking.estimated_error = std::hypot(mesh.error(), mesh.noise(), kLeftBySolution * error);
  phases.EndOfRays("gather", visibility.Counted().seconds);
  return baking;
}

/// The error that is likely to take `seconds`, after one that took `last_seconds`.
double AffordableError(double last_error, double last_seconds, double seconds) {
  // Halving the error takes 2 to 4 times as long.
  constexpr double kExponent = 0.6;
  return last_error * std::pow(last_seconds / seconds, kExponent);
}

/// The best that a time budget allows: a coarse baking that is soon done, or cut off, and finer ones as long
/// as they are likely to be done.
Baking BakeWithin(double budget, const Parameters& parameters, const Scene& scene, const Patches& patches,
                  const Visibility& visibility, Watch& watch, Phases& phases) {
  constexpr double kCoarsest = 0.3;
  constexpr double kSafe = 0.6;   // of the time that is left, what is planned with
  constexpr double kWorth = 0.8;  // of the last error, what is worth another baking
  const double gather_share = parameters.check > 0 ? kGatherShare : kGatherShareUnchecked;
  double error = std::max(kCoarsest, parameters.error);
  double begin = watch.Seconds();
  Baking best =
      BakeTo(error, kSolveShare, gather_share, parameters, scene, patches, visibility, watch, phases);
  while (!best.stopped() && best.end == MeshEnd::kError && error > parameters.error) {
    const double now = watch.Seconds();
    const double left = gather_share * budget - now;
    const double next =
        left > 0 ? std::max(parameters.error, AffordableError(error, now - begin, kSafe * left)) : error;
    if (next > kWorth * error && next > parameters.error) {
      best.solution.stopped = true;
      break;
    }
    error = next;
    begin = now;
    Baking finer =
        BakeTo(error, gather_share, gather_share, parameters, scene, patches, visibility, watch, phases);
    if (finer.stopped()) {
      best.solution.stopped = true;
      break;
    }
    best = std::move(finer);
  }
  return best;
}

}  // namespace

BakeResult Bake(const gltf::Source& source, const Parameters& asked, const ProgressCallback& callback,
                const gltf::Limits& limits) {
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

  watch.Report("solve", kImported);
  const Visibility visibility(patches);
  Baking baking =
      parameters.time_budget
          ? BakeWithin(*parameters.time_budget, parameters, scene, patches, visibility, watch, phases)
          : BakeTo(parameters.error, 1, 1, parameters, scene, patches, visibility, watch, phases);
  const BakedScene& baked = baking.output;
  phases.Finish();

  statistics.energy = baking.energy;
  statistics.iterations = std::move(baking.solution.iterations);
  statistics.solve_bytes = baking.solution.bytes;
  statistics.estimated_error = baking.estimated_error;
  statistics.stopped_by = baking.stopped()                ? StoppedBy::kTimeBudget
                          : baking.end == MeshEnd::kLimit ? StoppedBy::kLimit
                                                          : StoppedBy::kError;
  statistics.rays = visibility.Counted().rays;
  for (const BakedSurface& surface : baked.surfaces) {
    for (const BakedMesh* side : {&surface.front, &surface.back}) {
      statistics.output.vertices += side->vertices.size();
      statistics.output.triangles += side->triangles.size();
    }
  }
  statistics.output.exposure = baked.exposure;

  watch.progress().error = statistics.estimated_error;
  watch.Report("export", kGathered);
  result.glb = document.Export(baked);
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

}  // namespace radbake
