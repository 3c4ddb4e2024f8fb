#include "solver/bake/gather.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "solver/transport/form_factor.h"
#include "solver/transport/sampling.h"

namespace radbake {
namespace {

/// Signed distance from `x` to the nearest edge line of a convex polygon; positive inside.
double DepthInside(const Polygon& polygon, const Vec3& x) {
  double depth = std::numeric_limits<double>::infinity();
  for (int k = 0; k < polygon.count; ++k) {
    const Vec3 along = polygon[(k + 1) % polygon.count] - polygon[k];
    depth = std::min(depth, polygon.normal.cross(along).normalized().dot(x - polygon[k]));
  }
  return depth;
}

}  // namespace

Gatherer::Gatherer(const Hierarchy& hierarchy, const Light& light, const Links& links,
                   const Visibility& visibility, const GatherOptions& options)
    : hierarchy_(hierarchy), light_(light), links_(links), visibility_(visibility), options_(options) {
  double sum = 0;
  double area = 0;
  for (Index root = 0; root < hierarchy.root_count(); ++root) {
    const double e = Luminance(light.irradiance[root]);
    sum += hierarchy[root].area * e * e;
    area += hierarchy[root].area;
  }
  typical_ = std::sqrt(sum / area);
}

Index Gatherer::SolverLeaf(Index element, const Vec3& x) const {
  const auto solved = static_cast<Index>(light_.irradiance.size());
  // The output divides elements further than the solver did; those have no links of their own.
  while (element >= solved) {
    element = hierarchy_[element].parent;
  }
  while (!hierarchy_[element].IsLeaf() && hierarchy_[element].first_child < solved) {
    const Index first = hierarchy_[element].first_child;
    double deepest = -std::numeric_limits<double>::infinity();
    for (Index child = first; child < first + 4; ++child) {
      const double depth = DepthInside(hierarchy_.Shape(child), x);
      if (depth > deepest) {
        deepest = depth;
        element = child;
      }
    }
  }
  return element;
}

double Gatherer::PointVisibility(const Link& link, const Vec3& x, const Vec3& n, const Polygon& shooter,
                                 double share, QuasiRandom<2>& random) const {
  if (link.clear) {
    return 1;
  }
  // A shadow's edge shows in many small shooters at once: each gets a ray unless it hardly matters.
  constexpr double kNegligible = 0.02;
  const double rays = std::min(1.0, share) * options_.rays;
  return rays < kNegligible
             ? link.visibility
             : visibility_.FromPoint(x, n, shooter, random, std::max(1, static_cast<int>(std::lround(rays))));
}

Rgb Gatherer::Irradiance(const Vec3& x, Index leaf, std::uint64_t key) const {
  const Vec3& n = hierarchy_.PatchOf(leaf).normal;
  // A dark corner gets as many rays as its own light deserves, within reason.
  const double scale = std::max(Luminance(light_.irradiance[leaf]), 0.1 * typical_);
  QuasiRandom<2> random(key);
  Rgb sum = Rgb::Zero();
  for (Index e = leaf; e != kNone; e = hierarchy_[e].parent) {
    for (const Link& link : links_.Into(e)) {
      const Polygon shooter = hierarchy_.Shape(link.shooter);
      const Rgb open = PointToPolygon(x, n, shooter) * light_.Shooting(link.shooter);
      const double luminance = Luminance(open);
      if (luminance > 0) {
        sum += open * PointVisibility(link, x, n, shooter, luminance / scale, random);
      }
    }
  }
  return sum;
}

}  // namespace radbake
