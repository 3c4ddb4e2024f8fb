#include "solver/transport/node_transport.h"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <numbers>

#include "solver/transport/form_factor.h"
#include "solver/transport/punctual.h"
#include "solver/transport/sampling.h"

namespace radbake {
namespace {

/// cos·cos/(π·r²) times the shooter's area. The peak where two surfaces touch is cut off, or one point in it
/// would outweigh all others.
double AreaKernel(const SurfacePoint& from, const SurfacePoint& to, double to_area) {
  constexpr double kHighest = 64;
  const Vec3 along = to.x - from.x;
  const double out = along.dot(from.normal);
  const double in = -along.dot(to.normal);
  const double r2 = along.squaredNorm();
  if (out <= 0 || in <= 0 || r2 <= 0) {
    return 0;
  }
  return to_area * out * in / (r2 * (std::numbers::pi * r2 + to_area / kHighest));
}

struct Sphere {
  Vec3 centre = Vec3::Zero();
  double radius = 0;
};

Sphere SphereOf(const Hierarchy& hierarchy, Index node) {
  return {hierarchy.Centre(node), hierarchy.Radius(node)};
}

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
  const double area = light != nullptr ? 0 : hierarchy.Area(shooter);
  QuasiRandom<6> random(key);
  std::array<double, 2> all{};
  std::array<double, 2> open{};
  double highest = 0;
  double lowest = std::numeric_limits<double>::infinity();
  RayBatch batch(visibility);
  for (int k = 0; k < rays; ++k) {
    const auto u = random.Next();
    const SurfacePoint from = PointOfNode(hierarchy, receiver, {u[0], u[1], u[2]});
    double kernel = 0;
    Vec3 end;
    Index end_patch = kNone;
    if (light != nullptr) {
      kernel = PunctualKernel(*light, from.x, from.normal);
      end = ShadowRayEnd(*light, from.x);
    } else {
      const SurfacePoint to = PointOfNode(hierarchy, shooter, {u[3], u[4], u[5]});
      kernel = AreaKernel(from, to, area);
      end = to.x;
      end_patch = to.patch;
    }
    highest = std::max(highest, kernel);
    lowest = std::min(lowest, kernel);
    const std::size_t half = static_cast<std::size_t>(k) % 2;
    if (kernel > 0) {
      ++batch.rays;
      all[half] += kernel;
      open[half] += visibility.Blocked(from.x, from.patch, end, end_patch) ? 0 : kernel;
    }
  }
  const double sum = all[0] + all[1];
  result.form_factor = light != nullptr ? sum / rays : std::min(1.0, sum / rays);
  // The halves differ in their kernels too: what is carried is a ratio of means of one half.
  result.visibility.judged = all[0] > 0 ? open[0] / all[0] : 1;
  result.visibility.carried = all[1] > 0 ? open[1] / all[1] : result.visibility.judged;
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
    result.variation = highest - lowest;
    return result;
  }
  if (light != nullptr && light->kind == PunctualLight::Kind::kDirectional) {
    result.variation = kBasisError * std::max(result.form_factor, 1.0 / rays);
    return result;
  }
  // What all rays missed may be as much as one of them would have found.
  const Sphere to = light != nullptr ? Sphere{light->position, 0} : SphereOf(hierarchy, shooter);
  const Sphere from = SphereOf(hierarchy, receiver);
  const double distance2 = std::max((from.centre - to.centre).squaredNorm(), from.radius * from.radius);
  const double facing =
      light != nullptr ? 1 / distance2 : std::min(1.0, area / (std::numbers::pi * distance2));
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
  tbb::parallel_for(std::size_t{0}, openness.blocked_at.size(), [&](std::size_t p) {
    const auto patch = static_cast<Index>(p);
    const Polygon shape = hierarchy.Shape(patch);
    QuasiRandom<4> random(Hash(p));
    RayBatch batch(visibility);
    for (std::uint8_t& at : openness.blocked_at[p]) {
      const auto u = random.Next();
      const Vec3 x = PointOn(shape, u[0], u[1]);
      const Vec3 direction = CosineDirection(shape.normal, u[2], u[3]);
      ++batch.rays;
      const auto hit = visibility.caster().Closest(x, direction);
      at = 0;
      if (hit) {
        const Vec3 y = x + hit->distance * direction;
        Index c = clusters.Above(patch);
        while (c != 0 && (y - clusters[c].centre).norm() > clusters[c].radius) {
          c = clusters[c].parent;
        }
        at = static_cast<std::uint8_t>(std::min<std::uint32_t>(clusters[c].depth + 1, UINT8_MAX));
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
    const double kernel = AreaKernel({x, n, kNone}, to, area);
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
