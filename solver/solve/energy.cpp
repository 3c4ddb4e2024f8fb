#include "solver/solve/energy.h"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "solver/transport/sampling.h"

namespace radbake {
namespace {

constexpr std::size_t kRays = 65536;
constexpr std::size_t kBatch = 1024;

/// Power, normalised, of the rays of one batch.
struct Ends {
  Rgb emitted = Rgb::Zero();  // by lights without area and the sky
  Rgb escaped = Rgb::Zero();
  Rgb on_backs = Rgb::Zero();
};

struct Ray {
  Vec3 origin;
  Vec3 direction;
};

/// Where power sets out: a leaf, a light, or a side of the box around the scene through which distant light
/// comes in.
struct Origin {
  Rgb power;
  Index leaf = kNone;
  const PunctualLight* light = nullptr;
  int box_side = 0;
};

class Emitters {
 public:
  Emitters(const Hierarchy& hierarchy, const Light& light) : hierarchy_(hierarchy) {
    for (Index e = 0; e < hierarchy.size(); ++e) {
      if (hierarchy[e].IsLeaf() && !hierarchy.IsSky(e)) {
        Add({.power = hierarchy[e].area * light.radiosity[e], .leaf = e});
      }
    }
    AddDistant();
  }

  double power() const { return cumulative_.empty() ? 0 : cumulative_.back(); }
  const Origin& At(double power) const {
    const auto found = std::upper_bound(cumulative_.begin(), cumulative_.end() - 1, power);
    return origins_[static_cast<std::size_t>(found - cumulative_.begin())];
  }

  /// A ray of an origin that is no leaf.
  Ray Start(const Origin& origin, const std::array<double, 4>& u) const {
    if (origin.light != nullptr && origin.light->kind != PunctualLight::Kind::kDirectional) {
      const PunctualLight& light = *origin.light;
      const double lowest = LowestCosine(light);
      return {light.position, Around(light.direction, lowest + (1 - lowest) * u[0], u[1])};
    }
    const Polygon side = BoxSide(origin.box_side);
    return {PointOn(side, u[0], u[1]),
            origin.light != nullptr ? origin.light->direction : CosineDirection(side.normal, u[2], u[3])};
  }

 private:
  static double LowestCosine(const PunctualLight& light) {
    return light.kind == PunctualLight::Kind::kSpot ? light.outer_cosine : -1;
  }

  void Add(const Origin& origin) {
    const double power = Luminance(origin.power);
    if (power > 0) {
      origins_.push_back(origin);
      cumulative_.push_back((cumulative_.empty() ? 0 : cumulative_.back()) + power);
    }
  }

  void AddDistant() {
    for (const Blocker& blocker : hierarchy_.patches().blockers) {
      for (const Vec3& corner : blocker.corner) {
        box_.extend(corner);
      }
    }
    constexpr double kMargin = 0.01;
    box_ = {box_.min() - Vec3::Constant(kMargin), box_.max() + Vec3::Constant(kMargin)};
    const bool sky = hierarchy_.surface_root_count() < hierarchy_.root_count();
    for (int side = 0; side < 6; ++side) {
      const Polygon shape = BoxSide(side);
      if (sky) {
        const auto first = static_cast<Index>(hierarchy_.surface_root_count());
        Add({.power = Area(shape) * hierarchy_.PatchOf(first).emission, .box_side = side});
      }
      for (const PunctualLight& light : hierarchy_.patches().lights) {
        if (light.kind == PunctualLight::Kind::kDirectional) {
          const double facing = std::max(0.0, light.direction.dot(shape.normal));
          Add({.power = Area(shape) * facing * light.intensity, .light = &light, .box_side = side});
        }
      }
    }
    for (const PunctualLight& light : hierarchy_.patches().lights) {
      if (light.kind != PunctualLight::Kind::kDirectional) {
        Add({.power = 2 * std::numbers::pi * (1 - LowestCosine(light)) * light.intensity, .light = &light});
      }
    }
  }

  /// A side of the box, facing inwards.
  Polygon BoxSide(int side) const {
    const Eigen::Index axis = side / 2;
    const Vec3 out = (side % 2 == 0 ? 1.0 : -1.0) * Vec3::Unit(axis);
    const Vec3 half = 0.5 * box_.sizes();
    const Eigen::Index next = (axis + 1) % 3;
    const Vec3 u = half[next] * Vec3::Unit(next);
    const Eigen::Index last = (axis + 2) % 3;
    const Vec3 v = half[last] * Vec3::Unit(last);
    const Vec3 middle = box_.center() + half[axis] * out;
    Polygon polygon;
    polygon.count = 4;
    polygon.normal = -out;
    polygon.corner = {middle - u - v, middle + u - v, middle + u + v, middle - u + v};
    if (side % 2 == 0) {
      std::swap(polygon[1], polygon[3]);
    }
    return polygon;
  }

  const Hierarchy& hierarchy_;
  Eigen::AlignedBox3d box_;
  std::vector<Origin> origins_;
  std::vector<double> cumulative_;
};

class RayBalance {
 public:
  RayBalance(const Hierarchy& hierarchy, const Light& light, const Visibility& visibility)
      : hierarchy_(hierarchy), light_(light), visibility_(visibility), emitters_(hierarchy, light) {}

  /// Is there any light to follow?
  bool any() const { return emitters_.power() > 0; }

  Ends Trace(std::size_t batch) const {
    Ends ends;
    QuasiRandom<4> random(Hash(batch));
    std::uint64_t rays = kBatch;
    for (std::size_t k = 0; k < kBatch; ++k) {
      // Stratified over the origins: ray k of all batches together takes the k-th share of the power.
      const double at = (static_cast<double>(batch * kBatch + k) + 0.5) / kRays * emitters_.power();
      const Origin& origin = emitters_.At(at);
      const Ray ray =
          origin.leaf != kNone ? FromLeaf(origin.leaf, random, rays) : emitters_.Start(origin, random.Next());
      const auto hit = visibility_.caster().Closest(ray.origin, ray.direction);
      const Rgb carried = origin.power / Luminance(origin.power) * (emitters_.power() / kRays) *
                          Attenuation(origin, ray, hit) * Unevenness(origin, ray.origin);
      if (origin.leaf == kNone) {
        ends.emitted += carried;
      }
      if (!hit) {
        ends.escaped += carried;
      } else {
        const Blocker& blocker = hierarchy_.patches().blockers[hit->triangle];
        if ((hit->front ? blocker.front : blocker.back) == kNone) {
          ends.on_backs += carried;
        }
      }
    }
    visibility_.Count(rays);
    return ends;
  }

 private:
  /// From the part of the leaf that light reaches at all.
  Ray FromLeaf(Index leaf, QuasiRandom<4>& random, std::uint64_t& rays) const {
    const Polygon shape = hierarchy_.Shape(leaf);
    auto u = random.Next();
    constexpr int kTries = 32;
    Vec3 x = PointOn(shape, u[0], u[1]);
    for (int tries = 0; tries < kTries && visibility_.IsSealed(x, shape, rays); ++tries) {
      u = random.Next();
      x = PointOn(shape, u[0], u[1]);
    }
    return {x, CosineDirection(shape.normal, u[2], u[3])};
  }

  /// What leaves a leaf's polynomial at `x`, over its mean.
  Rgb Unevenness(const Origin& origin, const Vec3& x) const {
    if (origin.leaf == kNone || light_.basis.count() == 1) {
      return Rgb::Ones();
    }
    const ConstCoefficients polynomial = light_.ShootingPolynomial(origin.leaf);
    return (polynomial[0] > 0)
        .select(Evaluate(polynomial, light_.basis.At(origin.leaf, x)) / polynomial[0], 1.0);
  }

  /// The share of a light's intensity that arrives where the ray ends; a light with a range lights nothing
  /// beyond it.
  static double Attenuation(const Origin& origin, const Ray& ray, const std::optional<RayCaster::Hit>& hit) {
    if (origin.light == nullptr) {
      return 1;
    }
    constexpr double kFar = 1e3;
    return origin.light->Attenuation((hit ? hit->distance : kFar) * ray.direction);
  }

  const Hierarchy& hierarchy_;
  const Light& light_;
  const Visibility& visibility_;
  Emitters emitters_;
};

}  // namespace

EnergyBalance BalanceEnergy(const Hierarchy& hierarchy, const Light& light, const Visibility& visibility) {
  EnergyBalance balance;
  for (Index e = 0; e < hierarchy.size(); ++e) {
    if (hierarchy[e].IsLeaf() && !hierarchy.IsSky(e)) {
      const Patch& patch = hierarchy.PatchOf(e);
      balance.emitted += hierarchy[e].area * light.open[e] * patch.emission;
      balance.absorbed += hierarchy[e].area * (1 - patch.reflectance) * light.irradiance[e];
    }
  }
  const RayBalance rays(hierarchy, light, visibility);
  std::vector<Ends> ends(rays.any() ? kRays / kBatch : 0);
  tbb::parallel_for(std::size_t{0}, ends.size(), [&](std::size_t batch) { ends[batch] = rays.Trace(batch); });
  for (const Ends& part : ends) {
    balance.emitted += part.emitted;
    balance.escaped += part.escaped;
    balance.absorbed_by_backs += part.on_backs;
  }
  const Rgb rest = balance.emitted - balance.absorbed - balance.absorbed_by_backs - balance.escaped;
  const double emitted = Luminance(balance.emitted);
  balance.imbalance = emitted > 0 ? std::abs(Luminance(rest)) / emitted : 0;
  // Radiosity is per unit radiance and unit area; lm want both back.
  const Normalization& unit = hierarchy.patches().normalization;
  const double lumens = unit.radiance / (unit.scale * unit.scale);
  for (Rgb* part : {&balance.emitted, &balance.absorbed, &balance.absorbed_by_backs, &balance.escaped}) {
    *part *= lumens;
  }
  return balance;
}

}  // namespace radbake
