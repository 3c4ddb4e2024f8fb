/// Coarse bakes of extreme scenes, and what they say the light is.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <vector>

#include "solver/check/bake_lookup.h"
#include "solver/check/probes.h"
#include "tests/solve/solved_scene_test.h"
#include "tests/test_scenes.h"

namespace radbake::testing {

inline SolveOptions CoarseSolve() {
  SolveOptions options;
  options.a_min = 1e-3;
  options.w_min = 1e-3;
  return options;
}

inline MeshOptions CoarseMesh() {
  MeshOptions options;
  options.error = 0.03;
  options.start_area = 4e-3;
  options.min_area = 1e-5;
  return options;
}

/// The bake's vertices in world space, of fronts alone.
struct Baked {
  BakedTriangles triangles;
  std::vector<std::size_t> surface;  ///< by vertex
};

inline Baked Bake(const Scene& scene, SolvedScene& solved) {
  GatherOptions gather;
  gather.rays = 256;
  const Gatherer gatherer(solved.hierarchy, solved.solution.light, solved.solution.links, solved.visibility,
                          gather);
  OutputMesh mesh(solved.hierarchy, gatherer, solved.solution.links);
  mesh.Refine(CoarseMesh());
  const BakedScene output = Emit(solved.hierarchy, mesh, solved.surface_count, 1.0);
  Baked baked;
  for (std::size_t s = 0; s < scene.surfaces.size(); ++s) {
    const auto first = static_cast<Index>(baked.surface.size());
    for (const BakedVertex& vertex : output.surfaces[s].front.vertices) {
      Vec3 position = Vec3::Zero();
      for (std::size_t k = 0; k < vertex.source.size(); ++k) {
        if (vertex.weight[k] != 0) {
          position += static_cast<double>(vertex.weight[k]) * scene.surfaces[s].positions[vertex.source[k]];
        }
      }
      baked.triangles.positions.push_back(position);
      baked.triangles.irradiance.emplace_back(vertex.irradiance.cast<double>());
      baked.surface.push_back(s);
    }
    for (const Triangle& t : output.surfaces[s].front.triangles) {
      baked.triangles.triangles.push_back({first + t[0], first + t[1], first + t[2]});
    }
  }
  return baked;
}

inline Baked Bake(const Scene& scene, const SolveOptions& options = CoarseSolve()) {
  SolvedScene solved(scene, options);
  return Bake(scene, solved);
}

/// How far the vertices are from what they should be, relative to that.
struct Deviation {
  double worst = 0;
  double rms = 0;
  double mean = 0;
};

/// Of the vertices for which `expected(surface, position)` is above 0.
template <typename Expected>
Deviation DeviationFrom(const Baked& baked, const Expected& expected) {
  Deviation deviation;
  std::size_t count = 0;
  for (std::size_t i = 0; i < baked.surface.size(); ++i) {
    if (const double e = expected(baked.surface[i], baked.triangles.positions[i]); e > 0) {
      const double off = Luminance(baked.triangles.irradiance[i]) / e - 1;
      // Also if it is not a number.
      deviation.worst = std::abs(off) <= deviation.worst ? deviation.worst : std::abs(off);
      deviation.rms += off * off;
      deviation.mean += off;
      ++count;
    }
  }
  EXPECT_GT(count, 0U);
  deviation.rms = std::sqrt(deviation.rms / static_cast<double>(count));
  deviation.mean /= static_cast<double>(count);
  return deviation;
}

inline Deviation DeviationFrom(const Baked& baked, double expected) {
  return DeviationFrom(baked, [&](std::size_t, const Vec3&) { return expected; });
}

/// What a bake says at places that are a fixed part of the way across each triangle of the scene, whatever
/// its scale: relative RMS difference of the second bake, of an equal scene elsewhere, after `scale`.
struct Places {
  explicit Places(const Scene& scene, std::size_t count = 512)
      : traced(scene), places(DrawProbes(traced, count, 1)) {}

  std::vector<Rgb> Of(const Scene& moved, const Baked& baked) const {
    std::vector<Rgb> irradiance;
    for (const std::optional<Rgb>& found :
         LookUp(baked.triangles, TracedScene(moved).normalization, places)) {
      EXPECT_TRUE(found.has_value());
      irradiance.push_back(found.value_or(Rgb::Constant(std::nan(""))));
    }
    return irradiance;
  }

  TracedScene traced;
  std::vector<Place> places;
};

/// ‖scale·b − a‖ / ‖a‖.
inline double Difference(const std::vector<Rgb>& a, const std::vector<Rgb>& b, double scale = 1) {
  double difference = 0;
  double norm = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    difference += (scale * b[i] - a[i]).square().sum();
    norm += a[i].square().sum();
  }
  return std::sqrt(difference / norm);
}

}  // namespace radbake::testing
