#include "solver/bake/gather.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "solver/bake/element_centre.h"
#include "solver/bake/mesh_light.h"
#include "solver/bake/surroundings.h"
#include "solver/transport/coupling.h"
#include "solver/transport/node_transport.h"
#include "solver/transport/sampling.h"

namespace radbake {
namespace {

// Of form factors: beside what the links themselves leave it is nothing.
constexpr double kTolerance = 1e-3;

// Rays around a point, in those that go to a shooter that gives all of its light.
constexpr double kRaysAround = 1.3;

// Of the rays, what the smallest patches get.
constexpr double kLeastShare = 0.25;

// Form factor of a leaf that may be near.
constexpr double kClose = 0.05;

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
  if (options.by_rays) {
    emitters_.emplace(hierarchy);
    return;
  }
  seen_.reserve(light.irradiance.size());
  for (Index e = 0; e < light.irradiance.size(); ++e) {
    seen_.emplace_back(hierarchy.Shape(e));
  }
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
  return SolverLeafAt(hierarchy_, light_, element, x);
}

bool Gatherer::IsSealed(const Vec3& x, Index leaf) const {
  RayBatch batch(visibility_);
  return visibility_.IsSealed(x, hierarchy_.Shape(leaf), batch.rays);
}

double Gatherer::Chance(const Link& link, const Rgb& shooting, double form_factor, Look& look) const {
  const double chance = std::min(1.0, Luminance(shooting) / look.scale * look.effort * form_factor *
                                          Uncertainty(link) / options_.negligible);
  look.key = Hash(look.key);
  return static_cast<double>(look.key >> 11U) * 0x1p-53 < chance ? chance : 0;
}

Estimate Gatherer::Along(const Link& link, Look& look) const {
  const bool self = link.receiver == link.shooter;
  const double form_factor = std::max(link.form_factor, link.judged_factor);
  const Rgb shooting = self ? light_.cluster_radiosity[link.shooter - kFirstCluster].mean
                            : Shooting(link.shooter, form_factor, look);
  if (self) {
    return Seen(link, link.shooter, link.form_factor * shooting, Chance(link, shooting, form_factor, look),
                look);
  }
  return From(link, link.shooter, shooting, look);
}

Estimate Gatherer::From(const Link& link, Index shooter, const Rgb& shooting, Look& look) const {
  const double unoccluded = IsElement(shooter) ? seen_[shooter].From(look.x, look.n, kTolerance)
                                               : UnoccludedAt(hierarchy_, look.x, look.n, shooter);
  // By the point's own form factor: near a shooter it may be a thousand times the link's.
  const double chance = link.clear ? 1 : Chance(link, shooting, unoccluded, look);
  if (chance == 0 && link.visibility == 0) {
    return {};
  }
  if (!IsElement(shooter) || chance < 1) {
    return Seen(link, shooter, unoccluded * shooting, chance, look);
  }
  // What is near is seen in parts.
  if (!IsSolverLeaf(shooter) && unoccluded * light_.variation[shooter] > options_.uneven * look.scale) {
    Estimate sum;
    const Index first = hierarchy_[shooter].first_child;
    for (Index child = first; child < first + 4; ++child) {
      sum += From(link, child, Shooting(child, unoccluded, look), look);
    }
    return sum;
  }
  if (!IsUneven(shooter, unoccluded, look)) {
    return Seen(link, shooter, unoccluded * shooting, chance, look);
  }
  const Estimate near = ShootingNear(shooter, shooting, look);
  Estimate seen = Seen(link, shooter, unoccluded * near.irradiance, chance, look);
  seen.variance += unoccluded * unoccluded * near.variance;
  return seen;
}

Estimate Gatherer::Seen(const Link& link, Index shooter, const Rgb& open, double chance, Look& look) const {
  if (link.clear) {
    return {open};
  }
  const Rgb expected = link.visibility * open;
  if (chance == 0) {
    return {expected};
  }
  const double share = look.effort * Uncertainty(link) * std::min(1.0, Luminance(open) / look.scale);
  const int rays = chance < 1 ? 1 : std::max(1, static_cast<int>(std::lround(share * options_.rays)));
  double variance = 0;
  Rgb seen;
  if (IsElement(shooter)) {
    const double visible =
        visibility_.FromPoint(look.x, look.n, hierarchy_.Shape(shooter), look.on_polygon, rays);
    seen = visible * open;
    variance = visible * (1 - visible) * open.square().sum() * VarianceOfHits(rays);
  } else {
    seen = FromNodeAt(hierarchy_, light_, visibility_, look.x, look.n, shooter, look.on_cluster, rays);
  }
  const Rgb surprise = (seen - expected) / chance;
  if (chance < 1 || IsCluster(shooter)) {
    variance = surprise.square().sum() / rays;
  }
  return {expected + surprise, variance};
}

Rgb Gatherer::Shooting(Index shooter, double form_factor, const Look& look) const {
  if (!IsElement(shooter) || !light_.IsShaped(shooter)) {
    return light_.Shooting(hierarchy_, shooter, look.x);
  }
  const ConstCoefficients polynomial = light_.ShootingPolynomial(shooter);
  double shape = 0;
  for (const Rgb& coefficient : polynomial.subspan(1)) {
    shape += std::pow(Luminance(coefficient), 2);
  }
  // From far off all of it is seen as well, and even ones look the same from everywhere.
  constexpr double kEven = 0.005;
  constexpr double kLittle = 0.02;
  const double distance = (light_.basis[shooter].centroid() - look.x).norm();
  const double uneven = std::sqrt(shape) * std::min(1.0, 2 * std::sqrt(hierarchy_[shooter].area) / distance);
  if (uneven <= kEven * Luminance(polynomial[0]) ||
      form_factor * uneven <= kLittle * options_.negligible * look.scale) {
    return polynomial[0];
  }
  if (light_.basis.count() == BasisCount(BasisOrder::kLinear)) {
    const Vec3 middle = seen_[shooter].MiddleFrom(look.x, look.n);
    return Evaluate(polynomial, light_.basis.At(shooter, middle)).max(0.0);
  }
  const BasisEnd end(hierarchy_, light_.basis, shooter);
  return Evaluate(polynomial, SeenFrom(look.x, look.n, end)).max(0.0);
}

bool Gatherer::IsUneven(Index shooter, double form_factor, const Look& look) const {
  if (look.at_shooter || form_factor < kClose) {
    return false;
  }
  if (light_.open[shooter] < 1) {
    return true;
  }
  // A leaf does not know how uneven it is beyond its own constant or polynomial; where it lies, its parent
  // knows.
  const Index parent = hierarchy_[shooter].parent;
  double deviation = 0;
  if (parent != kNone) {
    deviation = light_.variation[parent];
    if (!light_.IsShaped(shooter)) {
      deviation += std::abs(Luminance(light_.Shooting(shooter)) - Luminance(light_.Shooting(parent)));
    }
  }
  return form_factor * deviation > options_.uneven * look.scale;
}

Estimate Gatherer::ShootingNear(Index shooter, const Rgb& otherwise, Look& look) const {
  // Directions that meet the shooter find its points by form factor, however near it is.
  constexpr int kDirections = 64;
  constexpr int kPoints = 2;
  constexpr double kEffort = 0.1;
  const Polygon shape = hierarchy_.Shape(shooter);
  look.key = Hash(look.key);
  QuasiRandom<2> random(look.key);
  Rgb sum = Rgb::Zero();
  Rgb squares = Rgb::Zero();
  int found = 0;
  for (int k = 0; k < kDirections && found < kPoints; ++k) {
    const auto u = random.Next();
    const Vec3 direction = CosineDirection(look.n, u[0], u[1]);
    const double towards = direction.dot(shape.normal);
    if (towards >= 0) {
      continue;
    }
    const Vec3 on_plane = look.x + (shape[0] - look.x).dot(shape.normal) / towards * direction;
    if (DepthInside(shape, on_plane) <= 0) {
      continue;
    }
    const Index leaf = SolverLeaf(shooter, on_plane);
    const Vec3 y = InsideNear(hierarchy_, leaf, on_plane);
    if (IsSealed(y, leaf)) {
      continue;
    }
    ++found;
    look.key = Hash(look.key);
    const Patch& patch = hierarchy_.PatchOf(leaf);
    const Look at_y = LookFrom(y, leaf, look.key, kEffort * look.effort, true, nullptr);
    const Rgb radiosity = patch.emission + patch.reflectance * Irradiance(leaf, at_y).irradiance;
    sum += radiosity;
    squares += radiosity.square();
  }
  if (found == 0) {
    return {otherwise};
  }
  const Rgb mean = sum / found;
  // Of one point, what it differs by says how much others would.
  return {mean, found > 1 ? (squares / found - mean.square()).max(0.0).sum() / (found - 1)
                          : (mean - otherwise).square().sum()};
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

Gatherer::Look Gatherer::LookFrom(const Vec3& x, Index leaf, std::uint64_t key, double effort,
                                  bool at_shooter, const MeshLight* mesh) const {
  // A dark corner gets as many rays as its own light deserves, within reason.
  return {x,
          hierarchy_.PatchOf(leaf).normal,
          std::max(Luminance(light_.irradiance[leaf]), 0.1 * typical_),
          effort,
          at_shooter,
          mesh,
          QuasiRandom<2>(key),
          QuasiRandom<3>(key),
          key};
}

Estimate Gatherer::Irradiance(const Vec3& x, Index leaf, std::uint64_t key, double effort,
                              const MeshLight* mesh) const {
  return Irradiance(leaf, LookFrom(x, leaf, key, effort, false, mesh));
}

template <typename Take>
Estimate Gatherer::AlongLinks(Index leaf, Look& look, const Take& take) const {
  Estimate sum;
  const auto add = [&](Index receiver) {
    for (const Link& link : links_.Into(receiver)) {
      if (take(link.shooter)) {
        sum += Along(link, look);
      }
    }
  };
  for (Index e = leaf; e != kNone; e = hierarchy_[e].parent) {
    add(e);
  }
  const Clusters& clusters = hierarchy_.clusters();
  for (Index c = clusters.Above(hierarchy_[leaf].patch); c != kNone; c = clusters[c].parent) {
    add(ClusterNode(c));
  }
  return sum;
}

Estimate Gatherer::ByRays(Look& look, Index leaf, double rays) const {
  Estimate sum = emitters_->At(visibility_, look.x, look.n, look.scale, rays, Hash(look.key ^ leaf));
  sum += FromSurroundings(hierarchy_, visibility_, look.x, look.n, rays, Hash(~look.key ^ leaf),
                          [&](const Met& met) { return Reflected(met, look.mesh); });
  if (!light_.punctual.empty()) {
    sum += AlongLinks(leaf, look, IsPunctual);
  }
  return sum;
}

Rgb Gatherer::Reflected(const Met& met, const MeshLight* mesh) const {
  const Patch& patch = hierarchy_.patches().patches[met.patch];
  if (mesh != nullptr) {
    return patch.reflectance * mesh->At(met.patch, met.y);
  }
  const Index leaf = SolverLeafAt(hierarchy_, light_, met.patch, met.y);
  const Rgb shooting = light_.IsShaped(leaf)
                           ? Evaluate(light_.ShootingPolynomial(leaf), light_.basis.At(leaf, met.y))
                           : light_.Shooting(leaf);
  return (shooting - patch.emission).max(0.0);
}

Estimate Gatherer::Irradiance(Index leaf, Look look) const {
  Estimate sum;
  if (emitters_) {
    const double small =
        std::sqrt(hierarchy_.PatchOf(leaf).area / (options_.full_area * hierarchy_.patches().area));
    const double rays = kRaysAround * options_.rays * look.effort * std::clamp(small, kLeastShare, 1.0);
    sum = ByRays(look, leaf, rays);
  } else {
    sum = AlongLinks(leaf, look, [](Index) { return true; });
  }
  sum.irradiance = sum.irradiance.max(0.0);
  return sum;
}

}  // namespace radbake
