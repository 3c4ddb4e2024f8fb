/// Irradiance at a point by path tracing: the truth that a bake is measured against.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "solver/check/traced_scene.h"

namespace radbake {

/// A point on a surface, and the normal of the side that is asked for.
struct Place {
  Vec3 point;
  Vec3 normal;
};

/// Estimates irradiance without bias (but for paths that meet an edge within rounding). At each vertex of a
/// path the direct light is sampled twice, by a point of a lamp and by a direction, the two combined by the
/// balance heuristic. Veach, Guibas: Optimally combining sampling techniques for Monte Carlo rendering, 1995.
/// Thread-safe.
class PathTracer {
 public:
  /// Keeps a reference to the scene.
  explicit PathTracer(const TracedScene& scene);

  struct Estimate {
    Rgb irradiance = Rgb::Zero();  ///< mean over the paths, in units of π·TracedScene::brightest
    std::size_t rays = 0;
  };
  /// The paths are a function of `stream` and evenly spread among themselves; the estimates of different
  /// streams are independent. `paths` is at least 1.
  Estimate Irradiance(const Place& place, std::uint32_t paths, std::uint64_t stream) const;

 private:
  struct Light {
    Index facet;
    double cumulative;  ///< probability of this light or an earlier one
  };

  /// The direct light from a random point of a lamp, weighted against sampling by direction.
  Rgb FromLights(const Place& place, std::array<double, 2> sample, std::size_t& rays) const;

  const TracedScene& scene_;
  RayCaster caster_;
  std::vector<Light> lights_;
  std::vector<double> light_density_;  ///< by facet: probability per area that a lamp's sample lies there
};

}  // namespace radbake
