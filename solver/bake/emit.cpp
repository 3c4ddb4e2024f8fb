#include "solver/bake/emit.h"

#include <algorithm>
#include <numbers>
#include <numeric>
#include <optional>
#include <unordered_map>

#include "solver/bake/element_centre.h"

namespace radbake {
namespace {

using Weights = std::array<float, 4>;  // of a patch's corners

Weights Midway(const Weights& a, const Weights& b) {
  Weights result{};
  for (std::size_t k = 0; k < 4; ++k) {
    result[k] = 0.5F * (a[k] + b[k]);
  }
  return result;
}

/// Collects one side of one surface. Elements that share a vertex, and the input vertices it is made of,
/// share it in the output.
class SurfaceBuilder {
 public:
  SurfaceBuilder(const OutputMesh& mesh, double lux, BakedMesh& out) : mesh_(mesh), lux_(lux), out_(out) {}

  /// `corners`: weights of the element's corners.
  void Add(const Hierarchy& hierarchy, Index e, const OutputMesh::Loop& loop,
           const std::array<Weights, 4>& corners) {
    const Element& element = hierarchy[e];
    const Patch& patch = hierarchy.PatchOf(e);
    const auto count = static_cast<std::size_t>(element.CornerCount());
    std::vector<Index> ring;
    std::size_t at = 0;
    for (std::size_t c = 0; c < count; ++c) {
      const std::size_t next = (c + 1) % count;
      std::size_t end = at + 1;
      while (end < loop.size() && (next == 0 || loop[end] != element.corner[next])) {
        ++end;
      }
      ring.push_back(Vertex(patch, loop[at], corners[c]));
      AddBetween(hierarchy, patch, loop[at], corners[c], end < loop.size() ? loop[end] : loop[0],
                 corners[next], std::span(loop).subspan(at + 1, end - at - 1), ring);
      at = end;
    }
    if (ring.size() == 3) {
      out_.triangles.push_back({ring[0], ring[1], ring[2]});
      return;
    }
    Weights centre{};
    const std::array<float, 4> share = CentreWeights(element.CornerCount());
    for (std::size_t c = 0; c < count; ++c) {
      for (std::size_t k = 0; k < 4; ++k) {
        centre[k] += share[c] * corners[c][k];
      }
    }
    const Index middle = NewVertex(patch, centre, mesh_.AtCentre(e).irradiance);
    for (std::size_t k = 0; k < ring.size(); ++k) {
      out_.triangles.push_back({middle, ring[k], ring[(k + 1) % ring.size()]});
    }
  }

 private:
  /// The vertices strictly between two neighbours on the outline, which halve it again and again.
  void AddBetween(const Hierarchy& hierarchy, const Patch& patch, Index from, const Weights& from_weights,
                  Index to, const Weights& to_weights, std::span<const Index> between,
                  std::vector<Index>& ring) {
    if (between.empty()) {
      return;
    }
    const Index middle_position =
        hierarchy.FindMidpoint(hierarchy.PositionOf(from), hierarchy.PositionOf(to));
    const auto middle = std::find_if(between.begin(), between.end(), [&](Index vertex) {
      return hierarchy.PositionOf(vertex) == middle_position;
    });
    const auto before = static_cast<std::size_t>(middle - between.begin());
    const Weights weights = Midway(from_weights, to_weights);
    AddBetween(hierarchy, patch, from, from_weights, *middle, weights, between.first(before), ring);
    ring.push_back(Vertex(patch, *middle, weights));
    AddBetween(hierarchy, patch, *middle, weights, to, to_weights, between.subspan(before + 1), ring);
  }

  Index Vertex(const Patch& patch, Index vertex, const Weights& weights) {
    const BakedVertex fresh = Make(patch, weights, mesh_.AtVertex(vertex).irradiance);
    std::vector<Index>& known = by_vertex_[vertex];
    for (const Index index : known) {
      if (out_.vertices[index].source == fresh.source && out_.vertices[index].weight == fresh.weight) {
        return index;
      }
    }
    out_.vertices.push_back(fresh);
    known.push_back(static_cast<Index>(out_.vertices.size() - 1));
    return known.back();
  }

  Index NewVertex(const Patch& patch, const Weights& weights, const Rgb& irradiance) {
    out_.vertices.push_back(Make(patch, weights, irradiance));
    return static_cast<Index>(out_.vertices.size() - 1);
  }

  /// Sources in ascending order, those of weight 0 dropped: equal places get equal bits.
  BakedVertex Make(const Patch& patch, const Weights& weights, const Rgb& irradiance) const {
    BakedVertex result;
    std::size_t count = 0;
    for (std::size_t k = 0; k < static_cast<std::size_t>(patch.corner_count); ++k) {
      if (weights[k] != 0) {
        std::size_t at = count++;
        for (; at > 0 && result.source[at - 1] > patch.source[k]; --at) {
          result.source[at] = result.source[at - 1];
          result.weight[at] = result.weight[at - 1];
        }
        result.source[at] = patch.source[k];
        result.weight[at] = weights[k];
      }
    }
    result.irradiance = (irradiance * lux_).max(0.0).cast<float>();
    return result;
  }

  const OutputMesh& mesh_;
  double lux_;
  BakedMesh& out_;
  std::unordered_map<Index, std::vector<Index>> by_vertex_;
};

/// Radiance of a white surface, by the channel that is brightest, that 98 % of the lit area stay below.
double AutoExposure(const Hierarchy& hierarchy, const OutputMesh& mesh, double lux) {
  std::vector<std::pair<double, double>> samples;  // value, area
  double area = 0;
  for (const Index e : mesh.cut()) {
    const double value = mesh.AtCentre(e).irradiance.maxCoeff();
    if (value > 0) {
      samples.emplace_back(value, hierarchy[e].area);
      area += hierarchy[e].area;
    }
  }
  if (samples.empty()) {
    return 1;
  }
  std::sort(samples.begin(), samples.end());
  constexpr double kWhite = 0.98;
  double below = 0;
  for (const auto& [value, share] : samples) {
    below += share;
    if (below >= kWhite * area) {
      return std::numbers::pi / (value * lux);
    }
  }
  return std::numbers::pi / (samples.back().first * lux);
}

}  // namespace

BakedScene Emit(const Hierarchy& hierarchy, const OutputMesh& mesh, std::size_t surface_count,
                std::optional<double> exposure) {
  const double lux = hierarchy.patches().normalization.radiance;
  BakedScene scene;
  scene.surfaces.resize(surface_count);
  scene.exposure = exposure ? *exposure : AutoExposure(hierarchy, mesh, lux);

  std::vector<Index> loop_of(hierarchy.size(), kNone);
  for (std::size_t k = 0; k < mesh.cut().size(); ++k) {
    loop_of[mesh.cut()[k]] = static_cast<Index>(k);
  }
  std::vector<std::array<std::optional<SurfaceBuilder>, 2>> builders(surface_count);
  const auto visit = [&](const auto& self, Index e, const std::array<Weights, 4>& corners) -> void {
    const Element& element = hierarchy[e];
    if (loop_of[e] != kNone) {
      const Patch& patch = hierarchy.PatchOf(e);
      BakedSurface& surface = scene.surfaces[patch.surface];
      auto& builder = builders[patch.surface][patch.back ? 1 : 0];
      if (!builder) {
        builder.emplace(mesh, lux, patch.back ? surface.back : surface.front);
      }
      builder->Add(hierarchy, e, mesh.loops()[loop_of[e]], corners);
      return;
    }
    const auto children = CornersOfChildren(element.division, corners, Midway, Weights{});
    for (Index k = 0; k < 4; ++k) {
      self(self, element.first_child + k, children[k]);
    }
  };
  const std::array<Weights, 4> unit = {Weights{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};
  for (Index root = 0; root < hierarchy.surface_root_count(); ++root) {
    visit(visit, root, unit);
  }
  return scene;
}

}  // namespace radbake
