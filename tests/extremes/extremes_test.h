/// Coarse bakes of extreme scenes, and what they say the light is.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>
#include <vector>

#include "solver/check/bake_lookup.h"
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
  std::vector<BakedVertex> vertices;
};

inline Baked Bake(const Scene& scene, SolvedScene& solved) {
  GatherOptions gather;
  gather.rays = 1024;
  const Gatherer gatherer(solved.hierarchy, solved.solution.light, solved.solution.links, solved.visibility,
                          gather);
  OutputMesh mesh(solved.hierarchy, gatherer, solved.solution.links);
  RefineMesh(mesh, CoarseMesh());
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
      baked.vertices.push_back(vertex);
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

/// ‖scale·b − a‖ / ‖a‖ of two bakes of one scene, wherever it stands: over the vertices that both have, by
/// their place in the scene's triangles. One ray that grazes an edge may decide whether a triangle of the
/// output is divided; so a few vertices are one bake's alone, and one that is sealed under a body is dark, or
/// has its open neighbours' light if a triangle reaches there: these are left out.
inline double Difference(const Baked& a, const Baked& b, double scale = 1) {
  const auto by_place = [](const Baked& baked) {
    std::map<std::vector<std::size_t>, Rgb> irradiance;
    for (std::size_t i = 0; i < baked.surface.size(); ++i) {
      std::vector<std::pair<std::size_t, std::size_t>> parts;
      for (std::size_t k = 0; k < baked.vertices[i].source.size(); ++k) {
        constexpr double kSteps = 1 << 14;
        const auto weight = static_cast<std::size_t>(std::lround(kSteps * baked.vertices[i].weight[k]));
        parts.emplace_back(baked.vertices[i].source[k], weight);
      }
      std::ranges::sort(parts);
      std::vector<std::size_t> place = {baked.surface[i]};
      for (const auto& [source, weight] : parts) {
        if (weight > 0) {
          place.insert(place.end(), {source, weight});
        }
      }
      irradiance[place] = baked.triangles.irradiance[i];
    }
    return irradiance;
  };
  const auto of_b = by_place(b);
  double difference = 0;
  double norm = 0;
  std::size_t shared = 0;
  for (const auto& [place, e] : by_place(a)) {
    if (const auto found = of_b.find(place); found != of_b.end()) {
      ++shared;
      if ((e == 0).all() || (found->second == 0).all()) {
        continue;
      }
      difference += (scale * found->second - e).square().sum();
      norm += e.square().sum();
    }
  }
  EXPECT_GT(shared, 0.98 * static_cast<double>(of_b.size()));
  return std::sqrt(difference / norm);
}

}  // namespace radbake::testing
