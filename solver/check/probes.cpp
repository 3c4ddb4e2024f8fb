#include "solver/check/probes.h"

#include <algorithm>
#include <cmath>

#include "solver/check/sample_points.h"

namespace radbake {
namespace {

struct Side {
  Index facet;
  bool front;
  double area_before;
};

}  // namespace

std::vector<Place> DrawProbes(const TracedScene& scene, std::size_t count, std::uint64_t stream) {
  std::vector<Side> sides;
  double area = 0;
  const auto add = [&](Index facet, bool front) {
    sides.push_back({.facet = facet, .front = front, .area_before = area});
    area += scene.facets[facet].area;
  };
  for (Index i = 0; i < scene.facets.size(); ++i) {
    if (scene.facets[i].front) {
      add(i, true);
    }
  }
  for (Index i = 0; i < scene.facets.size(); ++i) {
    if (scene.facets[i].back) {
      add(i, false);
    }
  }
  if (sides.empty()) {
    throw InputError("the scene has no diffuse surface");
  }

  const SamplePoints points(stream);
  std::vector<Place> probes;
  probes.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto index = static_cast<std::uint32_t>(i);
    const double jitter = points.Point(index, 0)[0];
    const double chosen = area * (static_cast<double>(i) + jitter) / static_cast<double>(count);
    const auto side =
        std::prev(std::ranges::upper_bound(sides.begin() + 1, sides.end(), chosen, {}, &Side::area_before));
    const Facet& facet = scene.facets[side->facet];
    const double u = std::clamp((chosen - side->area_before) / facet.area, 0.0, 1.0);
    probes.push_back({.point = PointOf(scene.corners[side->facet], {u, points.Point(index, 1)[0]}),
                      .normal = side->front ? facet.normal : Vec3(-facet.normal)});
  }
  return probes;
}

}  // namespace radbake
