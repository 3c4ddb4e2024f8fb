/// The measured error of a bake, by a path tracer that shares no transport code with the solver.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "solver/bake/baked_scene.h"
#include "solver/scene/scene.h"

namespace radbake {

struct CheckOptions {
  std::size_t probes = 1024;
  /// Standard error of a probe's path-traced irradiance that is small enough, relative to the scene's root
  /// mean square irradiance. It is taken out of the result and only widens the intervals: as large as the
  /// error that is to be measured is small enough, and costs a quarter of half as large.
  double probe_noise = 0.02;
  std::size_t max_paths = 65536;  ///< a probe's paths, at most (8 at least), after 64 that try it
  std::uint64_t seed = 1;
  /// Asked now and then, on the caller's thread; true ends the check early with the probes done so far, which
  /// are spread over the whole scene, or none.
  std::function<bool()> stop;
};

/// Relative RMS error = ‖E_bake − E‖ / ‖E‖ over the baked surface by area and the three channels, the path
/// tracer's own noise taken out. Probes where the bake has no surface count as `missing` and for nothing
/// else; those that nobody sees, as on a floor under a body, for nothing at all. The intervals tell how far
/// the same measurement with other probes and paths may lie; they know nothing of an error on a part of the
/// surface so small that no probe met it.
struct CheckSummary {
  std::size_t probes = 0;  ///< done, those where the bake is missing among them
  std::size_t paths = 0;   ///< traced for all probes
  std::size_t rays = 0;
  double error = 0;      ///< relative RMS error; 0 if it is below what the noise can tell
  double error_low = 0;  ///< its 95 % interval
  double error_high = 0;
  double bias = 0;           ///< mean of E_bake − E over mean of E
  double bias_interval = 0;  ///< half width of its 95 % interval
  double missing = 0;        ///< share of the probes to be seen where the bake has no surface
  double noise = 0;          ///< RMS standard error of the references, relative to ‖E‖
};

/// Draws probes over the diffuse surfaces of `scene` by area, path-traces the irradiance at each, and
/// compares with the linear interpolation of `baked` at the same place and side. The same on any number of
/// threads of oneTBB's current arena. Throws InputError if nothing in the scene emits, no surface is diffuse,
/// or the bake has no surface at any probe.
CheckSummary Check(const Scene& scene, const BakedTriangles& baked, const CheckOptions& options);

}  // namespace radbake
