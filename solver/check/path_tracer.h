/// Irradiance at a point by path tracing: the truth that a bake is measured against.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "solver/check/light_tree.h"
#include "solver/check/sky.h"
#include "solver/check/traced_scene.h"
#include "solver/scene/overlaps.h"

namespace radbake {

/// Estimates irradiance without bias (but for paths that meet an edge within rounding). At each vertex of a
/// path the direct light of surfaces and of the sky is sampled twice, by a point of a lamp and by a
/// direction, the two combined by the balance heuristic. Veach, Guibas: Optimally combining sampling
/// techniques for Monte Carlo rendering, 1995. Lights without area are met by no direction, and sampled
/// alone. Thread-safe.
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

  /// Of what the place sees, the share that is sides without light, by 16 rays. Where there is nothing else,
  /// as under a body that stands there, nobody sees the place either.
  double DeadShare(const Place& place) const;

 private:
  /// Lamps of the tree: first the facets that emit, then the lights with a position.
  static std::vector<LightTree::Lamp> Lamps(const TracedScene& scene);

  /// A point of a surface that emits, drawn with a density by area.
  struct Source {
    Vec3 point;
    Vec3 normal;
    bool back;  // it emits there too
    Rgb emission;
    double density;
    Index facet;  // kNone: of the sky
  };
  // Each is the direct light that one random sample finds, in the estimate's units.
  Rgb FromLamps(const Place& place, std::array<double, 2> sample, std::size_t& rays) const;
  Rgb FromSky(const Place& place, std::array<double, 2> sample, std::size_t& rays) const;
  Rgb FromSource(const Place& place, const Source& source, std::size_t& rays) const;
  Rgb FromPoint(const Place& place, const PunctualLight& light, std::size_t& rays) const;
  Rgb FromSuns(const Place& place, double sample, std::size_t& rays) const;

  /// A side of a facet, as Overlaps knows it.
  static Index Face(Index facet, bool front) { return 2 * facet + (front ? 0 : 1); }
  static Overlaps OverlapsOf(const TracedScene& scene);

  const TracedScene& scene_;
  RayCaster caster_;
  Overlaps overlaps_;
  Sky sky_;
  std::vector<Index> emitters_;     // facets
  std::vector<Index> lamp_;         // by facet: its lamp in the tree, or kNone
  std::vector<Index> points_;       // lights with a position
  std::vector<Index> suns_;         // directional lights
  std::vector<double> cumulative_;  // of the suns: probability of it or an earlier one
  LightTree lamps_;
};

}  // namespace radbake
