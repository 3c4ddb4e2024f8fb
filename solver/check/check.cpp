#include "solver/check/check.h"

#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "solver/check/bake_lookup.h"
#include "solver/check/comparison.h"
#include "solver/check/path_tracer.h"
#include "solver/check/probes.h"
#include "solver/check/sample_points.h"

namespace radbake {
namespace {

// A probe's variance is known from independent batches, each of paths that are evenly spread.
constexpr std::uint32_t kBatches = 8;
constexpr std::uint32_t kPilotPaths = 8;  // a batch

enum Purpose : std::uint64_t { kProbes, kPilot, kMain };

struct Reference {
  Rgb irradiance = Rgb::Zero();
  Rgb variance = Rgb::Zero();  // of `irradiance`, estimated
  std::size_t rays = 0;
};

Reference Trace(const PathTracer& tracer, const Place& place, std::uint32_t paths, std::uint64_t stream) {
  Reference reference;
  std::array<Rgb, kBatches> batches;
  for (std::uint32_t i = 0; i < kBatches; ++i) {
    const PathTracer::Estimate estimate = tracer.Irradiance(place, paths, SubStream(stream, i));
    batches[i] = estimate.irradiance;
    reference.irradiance += estimate.irradiance / kBatches;
    reference.rays += estimate.rays;
  }
  for (const Rgb& batch : batches) {
    reference.variance += (batch - reference.irradiance).square() / (kBatches * (kBatches - 1));
  }
  return reference;
}

// 0 … count − 1, every beginning of it spread evenly.
std::vector<std::size_t> SpreadOrder(std::size_t count) {
  std::vector<std::size_t> order;
  order.reserve(count);
  std::size_t reversed = 0;
  std::size_t size = 1;
  while (size < count) {
    size *= 2;
  }
  for (std::size_t i = 0; i < size; ++i) {
    if (reversed < count) {
      order.push_back(reversed);
    }
    std::size_t bit = size / 2;
    while ((reversed & bit) != 0) {
      reversed ^= bit;
      bit /= 2;
    }
    reversed |= bit;
  }
  return order;
}

// Does nobody see a place with that share of dead sides around it? Where two bodies touch, a ray inside of
// one may meet the other's side; but then no light is found.
bool IsHidden(double dead_share, const Rgb& irradiance) {
  constexpr double kHalf = 0.5;
  return dead_share == 1 || (dead_share >= kHalf && (irradiance == 0).all());
}

// Calls `trace` for each of `indices` on all threads, until `stop` says so; returns how many were done.
// `stop` is asked on the caller's thread.
template <typename Function>
std::size_t ForEach(const std::vector<std::size_t>& indices, const std::function<bool()>& stop,
                    const Function& trace) {
  const auto chunk =
      std::max<std::size_t>(32, 4 * static_cast<std::size_t>(tbb::this_task_arena::max_concurrency()));
  std::size_t done = 0;
  while (done < indices.size() && !(stop && stop())) {
    const std::size_t end = std::min(indices.size(), done + chunk);
    tbb::parallel_for(done, end, [&](std::size_t i) { trace(indices[i]); });
    done = end;
  }
  return done;
}

}  // namespace

CheckSummary Check(const Scene& scene, const BakedTriangles& baked, const CheckOptions& options) {
  const TracedScene traced(scene);
  if (!(traced.brightest > 0)) {
    throw InputError("nothing in the scene emits light");
  }
  const auto stream = [&](Purpose purpose) { return SubStream(Scramble(options.seed), purpose); };
  const std::vector<Place> probes = DrawProbes(traced, options.probes, stream(kProbes));
  const std::vector<std::optional<Rgb>> found = LookUp(baked, traced.normalization, probes);
  if (!found.empty() && std::ranges::none_of(found, [](const auto& rgb) { return rgb.has_value(); })) {
    throw InputError("the bake has no surface where the scene has one");
  }
  const PathTracer tracer(traced);
  const std::vector<std::size_t> order = SpreadOrder(probes.size());

  CheckSummary summary;
  std::vector<Reference> pilots(probes.size());
  std::vector<char> hidden(probes.size());
  const std::size_t piloted = ForEach(order, options.stop, [&](std::size_t i) {
    pilots[i] = Trace(tracer, probes[i], kPilotPaths, SubStream(stream(kPilot), i));
    hidden[i] = IsHidden(tracer.DeadShare(probes[i]), pilots[i].irradiance) ? 1 : 0;
  });
  Rgb energy = Rgb::Zero();
  Rgb variance = Rgb::Zero();
  for (const Reference& pilot : pilots) {
    energy += pilot.irradiance.square() - pilot.variance;
    variance += pilot.variance;
    summary.rays += pilot.rays;
  }
  summary.paths = piloted * kBatches * kPilotPaths;
  if (piloted < probes.size()) {
    return summary;
  }

  // The pilots only say how many paths a probe needs: a mean of paths whose number depends on them is biased.
  // Few batches say little of a variance, so half of the trust is in the mean variance of all probes.
  const auto count = static_cast<double>(probes.size());
  const double target = options.probe_noise * options.probe_noise * energy.sum() / count;
  const auto paths_of = [&](std::size_t i) {
    const double expected = (pilots[i].variance.sum() + variance.sum() / count) / 2;
    const auto most =
        static_cast<double>(std::clamp<std::size_t>(options.max_paths / kBatches, 1, UINT32_MAX));
    const double paths = target > 0 ? std::ceil(expected / target) * kPilotPaths : most;
    return static_cast<std::uint32_t>(std::clamp<double>(paths, std::min<double>(kPilotPaths, most), most));
  };
  std::vector<Reference> references(probes.size());
  const std::size_t done = ForEach(order, options.stop, [&](std::size_t i) {
    if (found[i] && hidden[i] == 0) {
      references[i] = Trace(tracer, probes[i], paths_of(i), SubStream(stream(kMain), i));
    }
  });

  std::vector<std::size_t> finished(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(done));
  std::ranges::sort(finished);
  std::vector<Comparison> comparisons;
  const double unit = std::numbers::pi * traced.brightest;
  std::size_t seen = 0;
  for (const std::size_t i : finished) {
    if (hidden[i] != 0) {
      continue;
    }
    ++seen;
    if (found[i]) {
      const Reference& reference = references[i];
      comparisons.push_back({.baked = *found[i] / unit,
                             .reference = reference.irradiance,
                             .variance = reference.variance.sum()});
      summary.paths += std::size_t{kBatches} * paths_of(i);
      summary.rays += reference.rays;
    }
  }
  summary.probes = done;
  summary.missing =
      seen == 0 ? 0 : static_cast<double>(seen - comparisons.size()) / static_cast<double>(seen);
  Compare(comparisons, summary);
  return summary;
}

}  // namespace radbake
