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
  /// Standard error of a probe's path-traced irradiance that is small enough, relative to the scene's root mean
  /// square irradiance.
  double probe_noise = 0.01;
  std::size_t max_paths = 65536;  ///< a probe's paths, at most
  std::uint64_t seed = 1;
  std::function<bool()> stop;  ///< asked now and then; true ends the check early with the probes done so far
};

/// Relative RMS error = ‖E_bake − E‖ / ‖E‖ over the baked surface by area and the three channels, the path
/// tracer's own noise taken out.
struct CheckSummary {
  std::size_t probes = 0;          ///< done
  std::size_t paths = 0;           ///< traced for all probes
  std::size_t rays = 0;
  double error = 0;                ///< relative RMS error
  double error_low = 0;            ///< its 95 % interval
  double error_high = 0;
  double bias = 0;                 ///< mean of E_bake − E over mean of E
  double bias_interval = 0;        ///< half width of its 95 % interval
  double missing = 0;              ///< share of probes where the bake has no surface
  double noise = 0;                ///< RMS standard error of the references, relative to ‖E‖
};

/// Draws probes over the diffuse surfaces of `scene` by area, path-traces the irradiance at each, and compares
/// with the linear interpolation of `baked` at the same place and side. The same on any number of threads.
CheckSummary Check(const Scene& scene, const BakedTriangles& baked, const CheckOptions& options);

}  // namespace radbake
