#include "solver/bake/gather.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>

#include "solver/transport/coupling.h"
#include "solver/transport/node_transport.h"
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

// Of form factors: beside what the links themselves leave it is nothing.
constexpr double kTolerance = 1e-3;

/// How far the visibility of a point of the receiver may be from the link's: much where that is neither 0 nor
/// 1.
double Uncertainty(const Link& link) {
  if (IsCluster(link.receiver)) {
    return 1;
  }
  constexpr double kLeast = 0.1;
  const double v = link.visibility;
  return std::max(kLeast, 2 * std::sqrt(std::max(0.0, v * (1 - v))));
}

}  // namespace

Gatherer::Gatherer(const Hierarchy& hierarchy, const Light& light, const Links& links,
                   const Visibility& visibility, const GatherOptions& options)
    : hierarchy_(hierarchy), light_(light), links_(links), visibility_(visibility), options_(options) {
  double sum = 0;
  double area = 0;
  for (Index root = 0; root < hierarchy.surface_root_count(); ++root) {
    const double e = Luminance(light.irradiance[root]);
    sum += hierarchy[root].area * e * e;
    area += hierarchy[root].area;
  }
  typical_ = std::sqrt(sum / area);
}

Index Gatherer::SolverLeaf(Index element, const Vec3& x) const {
  if (const Index patch = hierarchy_[element].patch, there = visibility_.overlaps().At(patch, x);
      there != patch) {
    element = there;
  }
  const auto solved = static_cast<Index>(light_.irradiance.size());
  // The output divides elements further than the solver did; those have no links of their own.
  while (element >= solved) {
    element = hierarchy_[element].parent;
  }
  while (!IsSolverLeaf(element)) {
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

bool Gatherer::IsSealed(const Vec3& x, Index leaf) const {
  RayBatch batch(visibility_);
  return visibility_.IsSealed(x, hierarchy_.Shape(leaf), batch.rays);
}

Estimate Gatherer::Along(const Link& link, Look& look) const {
  const Vec3& x = look.x;
  const Vec3& n = look.n;
  const bool self = link.receiver == link.shooter;
  const Rgb shooting =
      self ? light_.cluster_radiosity[link.shooter - kFirstCluster].mean : Shooting(link.shooter, x, n);
  const double brightness = Luminance(shooting) / look.scale;
  // A shadow's edge shows in many small shooters at once: each gets a ray unless it hardly matters.
  // Hundreds of links that hardly matter may err the same way, as in a cavity of a cluster: a few of them
  // cast a ray for all (Russian roulette).
  double chance = 1;
  const double uncertainty = Uncertainty(link);
  if (!link.clear) {
    const double form_factor = std::max(link.form_factor, link.judged_factor);
    chance = std::min(1.0, brightness * look.effort * form_factor * uncertainty / options_.negligible);
    look.key = Hash(look.key);
    if (static_cast<double>(look.key >> 11U) * 0x1p-53 >= chance) {
      chance = 0;
    }
  }
  if (chance == 0 && link.visibility == 0) {
    return {};
  }
  const double unoccluded =
      self ? static_cast<double>(link.form_factor) : UnoccludedAt(hierarchy_, x, n, link.shooter, kTolerance);
  const Rgb open = unoccluded * shooting;
  if (link.clear) {
    return {open};
  }
  const Rgb expected = link.visibility * open;
  if (chance == 0) {
    return {expected};
  }
  const double share = look.effort * uncertainty * std::min(1.0, Luminance(open) / look.scale);
  const int rays = chance < 1 ? 1 : std::max(1, static_cast<int>(std::lround(share * options_.rays)));
  double variance = 0;
  Rgb seen;
  if (IsElement(link.shooter)) {
    const double visible = visibility_.FromPoint(x, n, hierarchy_.Shape(link.shooter), look.on_polygon, rays);
    seen = visible * open;
    variance = visible * (1 - visible) * open.square().sum() / rays;
  } else {
    seen = FromNodeAt(hierarchy_, light_, visibility_, x, n, link.shooter, look.on_cluster, rays);
  }
  const Rgb surprise = (seen - expected) / chance;
  if (chance < 1 || IsCluster(link.shooter)) {
    variance = surprise.square().sum() / rays;
  }
  return {expected + surprise, variance};
}

Rgb Gatherer::Shooting(Index shooter, const Vec3& x, const Vec3& n) const {
  if (!IsElement(shooter) || !light_.IsShaped(shooter)) {
    return light_.Shooting(hierarchy_, shooter, x);
  }
  const ConstCoefficients polynomial = light_.ShootingPolynomial(shooter);
  double shape = 0;
  for (const Rgb& coefficient : polynomial.subspan(1)) {
    shape += std::pow(Luminance(coefficient), 2);
  }
  // From far off all of it is seen as well, and even ones look the same from everywhere.
  constexpr double kEven = 0.005;
  const double distance = (light_.basis[shooter].centroid() - x).norm();
  const double uneven = std::min(1.0, 2 * std::sqrt(hierarchy_[shooter].area) / distance);
  if (std::sqrt(shape) * uneven <= kEven * Luminance(polynomial[0])) {
    return polynomial[0];
  }
  const BasisEnd end(hierarchy_, light_.basis, shooter);
  return Evaluate(polynomial, SeenFrom(x, n, end)).max(0.0);
}

Rgb Gatherer::Solved(Index leaf, const Vec3& x) const {
  const double open = light_.open[leaf];
  if (!(open > 0)) {
    return Rgb::Zero();
  }
  if (light_.basis.count() > 1 && open == 1) {
    return Evaluate(light_.LightingPolynomial(leaf), light_.basis.At(leaf, x)).max(0.0);
  }
  return light_.irradiance[leaf] / open;
}

Estimate Gatherer::Irradiance(const Vec3& x, Index leaf, std::uint64_t key, double effort) const {
  // A dark corner gets as many rays as its own light deserves, within reason.
  Look look{x,
            hierarchy_.PatchOf(leaf).normal,
            std::max(Luminance(light_.irradiance[leaf]), 0.1 * typical_),
            effort,
            QuasiRandom<2>(key),
            QuasiRandom<3>(key),
            key};
  Estimate sum;
  const auto add = [&](Index receiver) {
    for (const Link& link : links_.Into(receiver)) {
      const Estimate part = Along(link, look);
      sum.irradiance += part.irradiance;
      sum.variance += part.variance;
    }
  };
  for (Index e = leaf; e != kNone; e = hierarchy_[e].parent) {
    add(e);
  }
  const Clusters& clusters = hierarchy_.clusters();
  for (Index c = clusters.Above(hierarchy_[leaf].patch); c != kNone; c = clusters[c].parent) {
    add(ClusterNode(c));
  }
  sum.irradiance = sum.irradiance.max(0.0);
  return sum;
}

}  // namespace radbake
