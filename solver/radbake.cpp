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

// Shares of a time budget after which solving, and dividing the output, stop.
constexpr double kSolveShare = 0.4;
constexpr double kGatherShare = 0.75;
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
struct ByMethod {
  Refinement refinement;
  double a_min_per_error;
};
constexpr std::array kByMethod{ByMethod{Refinement::kMatrix, 0.05}, ByMethod{Refinement::kTwoLevel, 0.005},
                               ByMethod{Refinement::kHierarchical, 0.02},
                               ByMethod{Refinement::kAdaptive, 1e-4}};

SolveOptions OptionsOf(const Parameters& parameters) {
  SolveOptions options;
  const ByMethod& by_method = kByMethod[static_cast<std::size_t>(parameters.method)];
  options.refinement = by_method.refinement;
  options.a_min =
      parameters.oracle.a_min.value_or(std::clamp(by_method.a_min_per_error * parameters.error, 1e-8, 1e-2));
  options.gradient = std::clamp(5 * parameters.error, 0.02, 1.0);
  options.f_max = parameters.oracle.f_max.value_or(std::clamp(parameters.error, 1e-3, 0.5));
  options.w_min = parameters.oracle.w_min.value_or(std::clamp(0.005 * parameters.error, 1e-8, 1e-2));
  options.tolerance = 0.02 * parameters.error;
  return options;
}

bool WantsClusters(const Parameters& parameters, std::size_t patches) {
  // Where the links between all pairs begin to cost more than the rest.
  constexpr std::size_t kMany = 400;
  return parameters.clustering == Clustering::kOn ||
         (parameters.clustering == Clustering::kAuto && patches > kMany);
}

MeshOptions MeshOptionsOf(const Parameters& parameters) {
  MeshOptions options;
  options.error = 0.5 * parameters.error;
  options.start_area = std::clamp(0.05 * parameters.error, 1e-5, 1e-2);
  options.min_area = 1e-4 * options.start_area;
  return options;
}

GatherOptions GatherOptionsOf(const Parameters& parameters) {
  GatherOptions options;
  options.rays = std::clamp(static_cast<int>(std::lround(4 / parameters.error)), 64, 4096);
  options.negligible = 0.02 * parameters.error;
  return options;
}

}  // namespace

BakeResult Bake(const gltf::Source& source, const Parameters& parameters, const ProgressCallback& callback,
                const gltf::Limits& limits) {
  Watch watch(parameters, callback);
  BakeResult result;
  Statistics& statistics = result.statistics;
  statistics.parameters = parameters;
  const auto end_phase = [&](const char* name) { statistics.seconds.emplace_back(name, watch.Lap()); };

  watch.Report("import", 0);
  gltf::Document document(source, limits);
  document.SetEnvironment(parameters.environment);
  const Scene& scene = document.scene();
  const Patches patches = CutIntoPatches(scene);
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
  end_phase("import");

  watch.Report("solve", kImported);
  Hierarchy hierarchy(patches, WantsClusters(parameters, patches.surface_patches));
  const Visibility visibility(patches);
  double processor_seconds = ProcessorSeconds();
  const double first_processor_seconds = processor_seconds;
  const auto end_phase_of_rays = [&](const char* name) {
    end_phase(name);
    const double before = std::exchange(processor_seconds, ProcessorSeconds());
    const double rays_before = std::exchange(statistics.ray_seconds, visibility.Counted().seconds);
    const double spent = processor_seconds - before;
    statistics.ray_shares.emplace_back(name, spent > 0 ? (statistics.ray_seconds - rays_before) / spent : 0);
  };
  SolveOptions solve_options = OptionsOf(parameters);
  solve_options.stop = [&](const Iteration& iteration) {
    watch.progress().iteration = iteration;
    // Each pass costs about as much as all before it.
    watch.Report("solve",
                 kSolved - (kSolved - kImported) * std::pow(0.7, static_cast<double>(iteration.pass)));
    return watch.Beyond(kSolveShare);
  };
  Solution solution = Solve(hierarchy, visibility, solve_options);
  end_phase_of_rays("solve");
  statistics.energy = BalanceEnergy(hierarchy, solution.light, visibility);
  end_phase_of_rays("energy");

  watch.Report("gather", kSolved);
  const Gatherer gatherer(hierarchy, solution.light, solution.links, visibility, GatherOptionsOf(parameters));
  OutputMesh mesh(hierarchy, gatherer, solution.links);
  MeshOptions mesh_options = MeshOptionsOf(parameters);
  mesh_options.stop = [&](double error, std::size_t /*vertices*/) {
    watch.progress().error = error;
    watch.Report("gather",
                 kGathered - (kGathered - kSolved) * std::clamp(1 - mesh_options.error / error, 0.0, 1.0));
    return watch.Beyond(kGatherShare);
  };
  const MeshEnd end = mesh.Refine(mesh_options);
  const BakedScene baked = Emit(hierarchy, mesh, scene.surfaces.size(), parameters.exposure);
  end_phase_of_rays("gather");
  statistics.ray_shares.emplace_back("all",
                                     statistics.ray_seconds / (processor_seconds - first_processor_seconds));

  statistics.iterations = std::move(solution.iterations);
  statistics.estimated_error = std::hypot(mesh.error(), 0.5 * parameters.error);
  statistics.stopped_by = solution.stopped || end == MeshEnd::kStopped ? StoppedBy::kTimeBudget
                          : end == MeshEnd::kLimit                     ? StoppedBy::kLimit
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
  end_phase("export");

  watch.Report("check", kExported);
  if (parameters.check > 0 && !watch.Beyond(kCheckShare)) {
    CheckOptions check;
    check.probes = parameters.check;
    check.stop = [&] { return watch.Beyond(kCheckShare); };
    const CheckSummary summary = Check(scene, gltf::ReadIrradiance({result.glb, {}}), check);
    if (summary.probes > 0) {
      statistics.measured = summary;
    }
    end_phase("check");
  }
  watch.Report("check", 1);
  statistics.peak_bytes = PeakBytes();
  return result;
}

}  // namespace radbake
