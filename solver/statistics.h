/// What a bake says of itself, beside its result (DESIGN section 2, Statistics).
#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "solver/check/check.h"
#include "solver/parameters.h"
#include "solver/scene/scene.h"
#include "solver/solve/solution.h"

namespace radbake {

/// kError: the estimated error is at most the target. kLimit: it is above, for want of memory, of vertices or
/// of rays.
enum class StoppedBy { kError, kTimeBudget, kLimit };

struct Statistics {
  Parameters parameters;
  struct {
    std::size_t triangles = 0;
    std::size_t patches = 0;
    std::size_t materials = 0;
    std::size_t lights = 0;  ///< emitting patches, lights without area, and the sky if it shines
    std::vector<Ignored> ignored;
  } scene;
  std::vector<Iteration> iterations;
  EnergyBalance energy;
  double estimated_error = 0;            ///< the bake's own estimate of its relative RMS error
  std::optional<CheckSummary> measured;  ///< nothing: `check` was 0 or there was no time for it
  std::vector<std::pair<std::string, double>> seconds;  ///< by phase, in the order they ran
  std::size_t memory_limit = 0;                         ///< bytes
  std::size_t peak_bytes = 0;                           ///< of the process
  SolveBytes solve_bytes;                               ///< of the elements and links of the last iteration
  std::uint64_t rays = 0;                               ///< of the bake, without the check's
  double ray_seconds = 0;                               ///< thread-seconds inside Embree (RayCaster::Seconds)
  /// By phase that casts rays, and for these phases together ("all"): the share of the processor time of the
  /// process that is spent inside Embree, 0 to 1.
  std::vector<std::pair<std::string, double>> ray_shares;
  struct {
    std::size_t vertices = 0;
    std::size_t triangles = 0;
    double exposure = 0;
  } output;
  StoppedBy stopped_by = StoppedBy::kError;
  std::vector<std::string> warnings;
};

/// {version, parameters, scene {triangles, patches, materials, lights, ignored [{feature, reason}]},
///  iterations [see below], energy {emitted, absorbed, absorbed_by_backs, escaped: [r, g, b] in lm;
///  imbalance}, error {estimated, measured: see below, or null}, time {each phase and total: s}, memory
///  {limit_bytes, peak_bytes, bytes_per_element, bytes_per_link: see SolveBytes}, rays {count, seconds, share
///  {solve, energy, gather, all: of its processor time}}, output {vertices, triangles, exposure: per cd/m²},
///  stopped_by "error" | "time_budget" | "limit", warnings [string]}
nlohmann::ordered_json ToJson(const Statistics& statistics);

/// {pass, sweeps, residual, elements, links, factors, rays, seconds}
nlohmann::ordered_json ToJson(const Iteration& iteration);

/// {relative_rms, low, high, bias, bias_interval, missing, probes, rays, noise}: shares, not percent.
nlohmann::ordered_json ToJson(const CheckSummary& summary);

}  // namespace radbake
