#include "solver/solve/energy.h"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>
#include <optional>

#include "solver/transport/sampling.h"

namespace radbake {
namespace {

constexpr std::size_t kRays = 65536;
constexpr std::size_t kBatch = 1024;

struct Ends {
  Rgb escaped = Rgb::Zero();
  Rgb on_backs = Rgb::Zero();
};

Vec3 CosineDirection(const Vec3& normal, double u, double v) {
  const double radius = std::sqrt(u);
  const double angle = 2 * std::numbers::pi * v;
  const Vec3 tangent = normal.unitOrthogonal();
  return radius * (std::cos(angle) * tangent + std::sin(angle) * normal.cross(tangent)) +
         std::sqrt(1 - u) * normal;
}

}  // namespace

EnergyBalance BalanceEnergy(const Hierarchy& hierarchy, const Light& light, const Visibility& visibility) {
  EnergyBalance balance;
  std::vector<Index> leaves;
  std::vector<double> cumulative;
  double power = 0;
  for (Index e = 0; e < hierarchy.size(); ++e) {
    if (hierarchy[e].IsLeaf()) {
      const Patch& patch = hierarchy.PatchOf(e);
      balance.emitted += hierarchy[e].area * patch.emission;
      balance.absorbed += hierarchy[e].area * (1 - patch.reflectance) * light.irradiance[e];
      power += hierarchy[e].area * Luminance(light.radiosity[e]);
      leaves.push_back(e);
      cumulative.push_back(power);
    }
  }
  std::vector<Ends> ends(kRays / kBatch);
  tbb::parallel_for(std::size_t{0}, ends.size(), [&](std::size_t batch) {
    const auto start = std::chrono::steady_clock::now();
    QuasiRandom<4> random(Hash(batch));
    std::uint64_t rays = kBatch;
    for (std::size_t k = 0; k < kBatch; ++k) {
      auto u = random.Next();
      // Stratified over the leaves: ray k of all batches together takes the k-th share of the power.
      const double at = (static_cast<double>(batch * kBatch + k) + 0.5) / kRays * power;
      const auto found = std::upper_bound(cumulative.begin(), cumulative.end(), at);
      const Index leaf = leaves[static_cast<std::size_t>(
          std::min(found - cumulative.begin(), static_cast<std::ptrdiff_t>(leaves.size()) - 1))];
      const Polygon shape = hierarchy.Shape(leaf);
      // From the part that light reaches at all.
      constexpr int kTries = 32;
      Vec3 x = PointOn(shape, u[0], u[1]);
      for (int tries = 0; tries < kTries && visibility.IsSealed(x, shape.normal, rays); ++tries) {
        u = random.Next();
        x = PointOn(shape, u[0], u[1]);
      }
      const Rgb& radiosity = light.radiosity[leaf];
      const Rgb carried = radiosity / Luminance(radiosity) * (power / kRays);
      const auto hit = visibility.caster().Closest(x, CosineDirection(shape.normal, u[2], u[3]));
      if (!hit) {
        ends[batch].escaped += carried;
      } else {
        const Blocker& blocker = hierarchy.patches().blockers[hit->triangle];
        if ((hit->front ? blocker.front : blocker.back) == kNone) {
          ends[batch].on_backs += carried;
        }
      }
    }
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - start;
    visibility.Count(rays, spent.count());
  });
  for (const Ends& part : ends) {
    balance.escaped += part.escaped;
    balance.absorbed_by_backs += part.on_backs;
  }
  const Rgb rest = balance.emitted - balance.absorbed - balance.absorbed_by_backs - balance.escaped;
  balance.imbalance = std::abs(Luminance(rest)) / Luminance(balance.emitted);
  // Radiosity is per unit radiance and unit area; lm want both back.
  const Normalization& unit = hierarchy.patches().normalization;
  const double lumens = unit.radiance / (unit.scale * unit.scale);
  for (Rgb* part : {&balance.emitted, &balance.absorbed, &balance.absorbed_by_backs, &balance.escaped}) {
    *part *= lumens;
  }
  return balance;
}

}  // namespace radbake
