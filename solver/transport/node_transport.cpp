#include "solver/transport/node_transport.h"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>

#include "solver/transport/punctual.h"
#include "solver/transport/sampling.h"
#include "solver/transport/seen_polygon.h"

namespace radbake {
namespace {

/// cos·cos/(π·r²).
double Kernel(const SurfacePoint& from, const SurfacePoint& to) {
  const Vec3 along = to.x - from.x;
  const double out = along.dot(from.normal);
  const double in = -along.dot(to.normal);
  const double r2 = along.squaredNorm();
  return out > 0 && in > 0 && r2 > 0 ? out * in / (std::numbers::pi * r2 * r2) : 0;
}

/// The peak where two surfaces touch is cut off, or one point in it would outweigh all others.
double Cut(double kernel) {
  constexpr double kHighest = 64;
  return kernel / (1 + kernel / kHighest);
}

struct Sphere {
  Vec3 centre = Vec3::Zero();
  double radius = 0;
};

Sphere SphereOf(const Hierarchy& hierarchy, Index node) {
  return {hierarchy.Centre(node), hierarchy.Radius(node)};
}

bool IsInside(const Polygon& polygon, const Vec3& x) {
  for (int k = 0; k < polygon.count; ++k) {
    const Vec3 along = polygon[(k + 1) % polygon.count] - polygon[k];
    if (polygon.normal.cross(along).dot(x - polygon[k]) < 0) {
      return false;
    }
  }
  return true;
}

/// The place that a ray from a point meets, if it is on a node.
std::optional<SurfacePoint> MeetOn(const Hierarchy& hierarchy, const Visibility& visibility, Index node,
                                   const SurfacePoint& from, const Vec3& direction) {
  const Overlaps& overlaps = visibility.overlaps();
  const auto hit = visibility.caster().Closest(from.x, direction);
  if (!hit || (!overlaps.empty() && overlaps.At(from.patch, from.x) != from.patch)) {
    return std::nullopt;
  }
  const Vec3 y = from.x + hit->distance * direction;
  const Blocker& blocker = hierarchy.patches().blockers[hit->triangle];
  Index patch = hit->front ? blocker.front : blocker.back;
  if (patch != kNone && !overlaps.empty()) {
    patch = overlaps.At(patch, y);
  }
  if (patch == kNone ||
      !(IsCluster(node) ? hierarchy.clusters().Holds(node - kFirstCluster, patch)
                        : patch == hierarchy[node].patch && IsInside(hierarchy.Shape(node), y))) {
    return std::nullopt;
  }
  return SurfacePoint{y, hierarchy.patches().patches[patch].normal, patch};
}

/// Is the shooter so near that the kernel times its area may exceed 1?
bool IsNear(const Hierarchy& hierarchy, const Sphere& receiver, const Sphere& shooter, Index node) {
  if (IsPunctual(node) || (IsElement(node) && hierarchy.IsSky(node))) {
    return false;
  }
  const double gap = (receiver.centre - shooter.centre).norm() - receiver.radius - shooter.radius;
  return gap <= 0 || hierarchy.Area(node) > std::numbers::pi * gap * gap;
}

/// Those of all rays, each patch once; their sum is 1.
std::vector<PatchShare> Shares(std::vector<PatchShare> found) {
  std::ranges::sort(found, {}, &PatchShare::patch);
  std::vector<PatchShare> shares;
  double sum = 0;
  for (const PatchShare& part : found) {
    sum += static_cast<double>(part.share);
    if (!shares.empty() && shares.back().patch == part.patch) {
      shares.back().share += part.share;
    } else {
      shares.push_back(part);
    }
  }
  for (PatchShare& part : shares) {
    part.share /= static_cast<float>(sum);
  }
  return shares;
}

/// Clusters of at most so many patches hand their light to those that a link's rays left from. Of more, the
/// few rays would light single patches far too much, and refinement would chase that noise.
constexpr std::size_t kFewPatches = 256;

/// Adds up what the rays of one link find.
class NodeSampler {
 public:
  NodeSampler(const Hierarchy& hierarchy, const Visibility& visibility, Index receiver, Index shooter)
      : hierarchy_(hierarchy),
        visibility_(visibility),
        receiver_(receiver),
        shooter_(shooter),
        area_(IsPunctual(shooter) ? 0 : hierarchy.Area(shooter)),
        few_receivers_(IsCluster(receiver) &&
                       hierarchy.clusters().PatchesBelow(receiver - kFirstCluster).size() <= kFewPatches) {}

  /// Two ways to draw a ray: by area on both ends, whose kernel has no bound where the two are near; and by
  /// the cosine at the receiver, which hardly meets what is far. Each ray counts by the density of both
  /// together (the balance heuristic: Veach and Guibas, SIGGRAPH 1995), so none by more than 1.
  void Sample(bool near, std::uint64_t key, int rays, RayBatch& batch) {
    QuasiRandom<6> random(key);
    const int pairs = near ? rays / 2 : rays;
    for (int k = 0; k < pairs; ++k) {
      Between(random.Next(), near, 1.0 / pairs, batch);
    }
    for (int k = pairs; k < rays; ++k) {
      From(random.Next(), 1.0 / (rays - pairs), batch);
    }
  }

  /// Form factor, visibility, sources and receivers.
  NodeTransport Result() && {
    NodeTransport result;
    result.visibility = open_ > 0 ? open_ / all_ : 1;
    result.form_factor = (open_ + met_) / result.visibility;
    if (!(result.form_factor > 0) && all_ > 0) {
      result.form_factor = all_;
      result.visibility = 0;
    }
    result.sources = Shares(std::move(sources_));
    result.receivers = Shares(std::move(receivers_));
    return result;
  }
  /// Over the rays between points: the difference of the largest kernel and the smallest.
  double range() const { return highest_ - lowest_; }

 private:
  void Between(const std::array<double, 6>& u, bool near, double weight, RayBatch& batch) {
    const SurfacePoint from = PointOfNode(hierarchy_, receiver_, {u[0], u[1], u[2]});
    double kernel = 0;
    SurfacePoint to;
    if (IsPunctual(shooter_)) {
      const PunctualLight& light = hierarchy_.patches().lights[shooter_ - kFirstPunctual];
      kernel = PunctualKernel(light, from.x, from.normal);
      to.x = ShadowRayEnd(light, from.x);
    } else {
      to = PointOfNode(hierarchy_, shooter_, {u[3], u[4], u[5]});
      kernel = area_ * Kernel(from, to);
      kernel = near ? kernel / (1 + kernel) : kernel;
    }
    highest_ = std::max(highest_, kernel);
    lowest_ = std::min(lowest_, kernel);
    if (!(kernel > 0)) {
      return;
    }
    ++batch.rays;
    all_ += weight * kernel;
    if (!visibility_.Blocked(from.x, from.patch, to.x, to.patch)) {
      open_ += weight * kernel;
      Note(from.patch, to.patch, weight * kernel);
    }
  }

  void From(const std::array<double, 6>& u, double weight, RayBatch& batch) {
    const SurfacePoint from = PointOfNode(hierarchy_, receiver_, {u[0], u[1], u[2]});
    ++batch.rays;
    const Vec3 direction = CosineDirection(from.normal, u[3], u[4]);
    if (const auto to = MeetOn(hierarchy_, visibility_, shooter_, from, direction)) {
      const double kernel = area_ * Kernel(from, *to);
      met_ += weight * kernel / (1 + kernel);
      Note(from.patch, to->patch, weight * kernel / (1 + kernel));
    }
  }

  void Note(Index receiver, Index source, double share) {
    const auto rounded = static_cast<float>(share);
    if (IsCluster(shooter_) && rounded > 0) {
      sources_.push_back({source, rounded});
    }
    if (few_receivers_ && rounded > 0) {
      receivers_.push_back({receiver, rounded});
    }
  }

  const Hierarchy& hierarchy_;
  const Visibility& visibility_;
  Index receiver_;
  Index shooter_;
  double area_;
  bool few_receivers_;
  double all_ = 0;   // what the rays between points would bring
  double open_ = 0;  // what they bring
  double met_ = 0;   // what those from the receiver bring
  double highest_ = 0;
  double lowest_ = std::numeric_limits<double>::infinity();
  std::vector<PatchShare> sources_;
  std::vector<PatchShare> receivers_;
};

/// Does the sphere of a cluster lie behind an element's plane?
bool IsBehind(const Hierarchy& hierarchy, Index element, const Sphere& sphere) {
  return PlaneOf(hierarchy.Shape(element)).Distance(sphere.centre) + sphere.radius <=
         hierarchy.patches().weld;
}

bool CannotFace(const Hierarchy& hierarchy, Index receiver, Index shooter) {
  return (IsElement(receiver) && IsCluster(shooter) &&
          IsBehind(hierarchy, receiver, SphereOf(hierarchy, shooter))) ||
         (IsElement(shooter) && IsCluster(receiver) &&
          IsBehind(hierarchy, shooter, SphereOf(hierarchy, receiver)));
}

/// A share of the form factor by which a cluster's own directions are off: see CosineBasis.
constexpr double kBasisError = 0.1;

/// How much the kernel may vary over a receiver and a shooter of these extents, as a share of itself.
double Spread(const Sphere& receiver, const Sphere& shooter, bool receiver_is_cluster) {
  const double distance = (receiver.centre - shooter.centre).norm();
  const double t = (receiver.radius + shooter.radius) / distance;
  constexpr double kMost = 1e6;
  const double by_extent = t < 1 ? std::min(kMost, 2 * t / ((1 - t) * (1 - t))) : kMost;
  return by_extent + (receiver_is_cluster ? kBasisError : 0);
}

}  // namespace

SurfacePoint PointOfNode(const Hierarchy& hierarchy, Index node, std::array<double, 3> u) {
  const Index element = IsCluster(node) ? hierarchy.clusters().PatchAt(node - kFirstCluster, u[0]) : node;
  const Polygon shape = hierarchy.Shape(element);
  return {PointOn(shape, u[1], u[2]), shape.normal, shape.patch};
}

NodeTransport BetweenNodes(const Hierarchy& hierarchy, const Visibility& visibility, Index receiver,
                           Index shooter, std::uint64_t key, int rays) {
  NodeTransport result;
  if (CannotFace(hierarchy, receiver, shooter)) {
    return result;
  }
  const PunctualLight* light =
      IsPunctual(shooter) ? &hierarchy.patches().lights[shooter - kFirstPunctual] : nullptr;
  const Sphere from = SphereOf(hierarchy, receiver);
  const Sphere to = light != nullptr ? Sphere{light->position, 0} : SphereOf(hierarchy, shooter);
  NodeSampler sampler(hierarchy, visibility, receiver, shooter);
  RayBatch batch(visibility);
  sampler.Sample(IsNear(hierarchy, from, to, shooter), key, rays, batch);
  const double range = sampler.range();
  result = std::move(sampler).Result();
  if (light != nullptr && IsElement(receiver)) {
    // Points cost nothing beside rays.
    constexpr int kPoints = 512;
    double integral = 0;
    const Polygon shape = hierarchy.Shape(receiver);
    QuasiRandom<2> points(key);
    for (int k = 0; k < kPoints; ++k) {
      const auto u = points.Next();
      integral += PunctualKernel(*light, PointOn(shape, u[0], u[1]), shape.normal);
    }
    result.form_factor = integral / kPoints;
    result.variation = range;
    return result;
  }
  if (light != nullptr && light->kind == PunctualLight::Kind::kDirectional) {
    result.variation = kBasisError * std::max(result.form_factor, 1.0 / rays);
    return result;
  }
  // What all rays missed may be as much as one of them would have found.
  const double distance2 = std::max((from.centre - to.centre).squaredNorm(), from.radius * from.radius);
  const double facing = light != nullptr
                            ? 1 / distance2
                            : std::min(1.0, hierarchy.Area(shooter) / (std::numbers::pi * distance2));
  const double found = std::max(result.form_factor, facing / rays);
  const double spread = receiver == shooter ? 1 / found : Spread(from, to, IsCluster(receiver));
  result.variation = found * spread;
  if (light == nullptr) {
    result.variation = std::min(result.variation, 1.0);
  }
  return result;
}

Openness LookAround(const Hierarchy& hierarchy, const Visibility& visibility) {
  const Clusters& clusters = hierarchy.clusters();
  Openness openness;
  openness.blocked_at.resize(clusters.empty() ? 0 : hierarchy.surface_root_count());
  openness.met_at.resize(openness.blocked_at.size());
  const auto one_more = [&](Index c) {
    return static_cast<std::uint8_t>(std::min<std::uint32_t>(clusters[c].depth + 1, UINT8_MAX));
  };
  tbb::parallel_for(std::size_t{0}, openness.blocked_at.size(), [&](std::size_t p) {
    const auto patch = static_cast<Index>(p);
    const Polygon shape = hierarchy.Shape(patch);
    QuasiRandom<4> random(Hash(p));
    RayBatch batch(visibility);
    for (std::size_t k = 0; k < Openness::kRays; ++k) {
      const auto u = random.Next();
      const Vec3 x = PointOn(shape, u[0], u[1]);
      const Vec3 direction = CosineDirection(shape.normal, u[2], u[3]);
      ++batch.rays;
      openness.blocked_at[p][k] = openness.met_at[p][k] = 0;
      const auto hit = visibility.caster().Closest(x, direction);
      if (!hit) {
        continue;
      }
      const Vec3 y = x + hit->distance * direction;
      Index c = clusters.Above(patch);
      while (c != 0 && (y - clusters[c].centre).norm() > clusters[c].radius) {
        c = clusters[c].parent;
      }
      openness.blocked_at[p][k] = one_more(c);
      const Blocker& blocker = hierarchy.patches().blockers[hit->triangle];
      if (const Index met = hit->front ? blocker.front : blocker.back; met != kNone) {
        c = clusters.Above(patch);
        while (!clusters.Holds(c, met)) {
          c = clusters[c].parent;
        }
        openness.met_at[p][k] = one_more(c);
      }
    }
  });
  return openness;
}

bool ClearToLight(const Visibility& visibility, const Polygon& receiver, const PunctualLight& light) {
  Polygon end = receiver;
  if (light.kind == PunctualLight::Kind::kDirectional) {
    // Every shadow ray ends on a copy of the receiver.
    for (int k = 0; k < receiver.count; ++k) {
      end[k] = ShadowRayEnd(light, receiver[k]);
    }
    end.normal = -receiver.normal;
    return visibility.Clear(receiver, end);
  }
  end.count = 3;
  end.corner.fill(light.position);
  end.normal = (receiver.Centroid() - light.position).normalized();
  for (int k = 0; k < receiver.count; ++k) {
    if (end.normal.dot(receiver[k] - light.position) <= 0) {
      return false;
    }
  }
  return visibility.Clear(receiver, end);
}

double FormFactorTolerance(const Patches& patches) {
  constexpr double kMost = 1e-4;
  constexpr double kLeft = 5e-4;
  double reflectance = 0;
  for (const Patch& patch : patches.patches) {
    reflectance = std::max(reflectance, patch.reflectance.maxCoeff());
  }
  return std::min(kMost, kLeft * (1 - reflectance));
}

double UnoccludedAt(const Hierarchy& hierarchy, const Vec3& x, const Vec3& n, Index shooter,
                    double tolerance) {
  if (IsPunctual(shooter)) {
    return PunctualKernel(hierarchy.patches().lights[shooter - kFirstPunctual], x, n);
  }
  if (IsElement(shooter)) {
    return PointToPolygon(x, n, hierarchy.Shape(shooter), tolerance);
  }
  const Cluster& cluster = hierarchy.clusters()[shooter - kFirstCluster];
  const Vec3 along = cluster.centre - x;
  const double distance = along.norm();
  if (!(distance > 0)) {
    return 0;
  }
  const double seen = std::max(0.0, Evaluate(cluster.extent, CosineBasis(-along / distance)));
  const double r2 = std::max(distance * distance, cluster.radius * cluster.radius);
  return std::max(0.0, n.dot(along) / distance) * seen * cluster.area / (std::numbers::pi * r2);
}

Rgb FromNodeAt(const Hierarchy& hierarchy, const Light& light, const Visibility& visibility, const Vec3& x,
               const Vec3& n, Index shooter, QuasiRandom<3>& random, int rays) {
  RayBatch batch(visibility);
  if (IsPunctual(shooter)) {
    const PunctualLight& punctual = hierarchy.patches().lights[shooter - kFirstPunctual];
    const double kernel = PunctualKernel(punctual, x, n);
    if (!(kernel > 0)) {
      return Rgb::Zero();
    }
    ++batch.rays;
    return visibility.caster().Occluded(x, ShadowRayEnd(punctual, x))
               ? Rgb::Zero().eval()
               : Rgb(kernel * light.punctual[shooter - kFirstPunctual]);
  }
  const double area = hierarchy.Area(shooter);
  Rgb sum = Rgb::Zero();
  for (int k = 0; k < rays; ++k) {
    const SurfacePoint to = PointOfNode(hierarchy, shooter, random.Next());
    const double kernel = Cut(area * Kernel({x, n, kNone}, to));
    if (kernel > 0) {
      ++batch.rays;
      if (!visibility.Blocked(x, kNone, to.x, to.patch)) {
        sum += kernel * light.Shooting(to.patch);
      }
    }
  }
  return sum / rays;
}

}  // namespace radbake
