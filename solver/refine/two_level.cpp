#include "solver/refine/two_level.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace radbake {
namespace {

template <typename Visit>
void ForEachSurfaceLeaf(const Hierarchy& hierarchy, const Visit& visit) {
  for (Index e = 0; e < hierarchy.size(); ++e) {
    if (hierarchy[e].IsLeaf() && !hierarchy.IsSky(e)) {
      visit(e);
    }
  }
}

template <typename Visit>
void ForEachVertex(const Element& element, const Visit& visit) {
  for (std::size_t k = 0; k < static_cast<std::size_t>(element.CornerCount()); ++k) {
    visit(element.corner[k]);
  }
}

}  // namespace

Decision TwoLevelOracle::Judge(const Hierarchy& hierarchy, const Link& link) const {
  if (IsDivisible(hierarchy, link.shooter, areas_.patch)) {
    return Decision::kDivideShooter;
  }
  return IsDivisible(hierarchy, link.receiver, areas_.element) ||
                 std::binary_search(steep_.begin(), steep_.end(), link.receiver)
             ? Decision::kDivideReceiver
             : Decision::kKeep;
}

std::vector<Index> PatchLevel(const Hierarchy& hierarchy, double patch_area) {
  std::vector<Index> patches;
  for (Index e = 0; e < hierarchy.size(); ++e) {
    const Element& element = hierarchy[e];
    const bool above = !element.IsLeaf() && IsDivisible(hierarchy, e, patch_area);
    const bool below = element.parent != kNone && !IsDivisible(hierarchy, element.parent, patch_area);
    if (!above && !below && !hierarchy.IsSky(e)) {
      patches.push_back(e);
    }
  }
  return patches;
}

std::vector<Index> SteepElements(const Hierarchy& hierarchy, const Light& light, double gradient,
                                 double smallest) {
  struct Range {
    double low = std::numeric_limits<double>::infinity();
    double high = 0;
  };
  std::vector<Range> around(hierarchy.vertex_count());
  double squares = 0;
  double area = 0;
  ForEachSurfaceLeaf(hierarchy, [&](Index leaf) {
    const double e = Luminance(light.irradiance[leaf]);
    squares += hierarchy[leaf].area * e * e;
    area += hierarchy[leaf].area;
    ForEachVertex(hierarchy[leaf], [&](Index vertex) {
      around[vertex].low = std::min(around[vertex].low, e);
      around[vertex].high = std::max(around[vertex].high, e);
    });
  });
  const double most = gradient * std::sqrt(squares / area);
  std::vector<Index> steep;
  ForEachSurfaceLeaf(hierarchy, [&](Index leaf) {
    const double e = Luminance(light.irradiance[leaf]);
    double difference = 0;
    ForEachVertex(hierarchy[leaf], [&](Index vertex) {
      difference = std::max({difference, around[vertex].high - e, e - around[vertex].low});
    });
    if (difference > most && hierarchy[leaf].area > smallest) {
      steep.push_back(leaf);
    }
  });
  return steep;
}

}  // namespace radbake
