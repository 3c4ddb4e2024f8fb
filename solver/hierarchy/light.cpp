#include "solver/hierarchy/light.h"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

namespace radbake {

double Openness::Share(Index patch, std::uint32_t depth) const {
  const auto& rays = blocked_at[patch];
  return static_cast<double>(std::ranges::count_if(rays, [&](std::uint8_t at) { return at <= depth; })) /
         static_cast<double>(kRays);
}

double Openness::Enclosed(Index patch, std::uint32_t depth) const {
  const auto& rays = met_at[patch];
  return static_cast<double>(std::ranges::count_if(rays, [&](std::uint8_t at) { return at > depth; })) /
         static_cast<double>(kRays);
}

Rgb ClusterRadiosity::Towards(const CosineSum& basis, const CosineSum& aperture) const {
  // A ratio of two sums of cosines over the same patches: the errors of the basis all but cancel, unless
  // hardly anything is seen.
  constexpr double kHardly = 0.02;
  const double seen = Evaluate(aperture, basis);
  return seen > kHardly * static_cast<double>(aperture[0]) ? Rgb(Evaluate(by_direction, basis) / seen) : mean;
}

ClusterRadiosity RadiosityOf(const Hierarchy& hierarchy, const Openness& openness, Index c,
                             std::span<const Rgb> shooting) {
  const Cluster& cluster = hierarchy.clusters()[c];
  ClusterRadiosity result;
  for (const Index patch : hierarchy.clusters().PatchesBelow(c)) {
    const Rgb weighted = hierarchy[patch].area / cluster.area * shooting[patch];
    result.mean += weighted;
    const Rgb out = openness.Share(patch, cluster.depth) * weighted;
    result.by_direction +=
        (hierarchy.clusters().BasisOf(patch).matrix() * out.cast<float>().matrix().transpose()).array();
  }
  return result;
}

Vec3 DirectionTo(const Hierarchy& hierarchy, Index node, const Vec3& x) {
  if (!IsPunctual(node)) {
    return (hierarchy.Centre(node) - x).normalized();
  }
  const PunctualLight& light = hierarchy.patches().lights[node - kFirstPunctual];
  return light.kind == PunctualLight::Kind::kDirectional ? Vec3(-light.direction)
                                                         : Vec3((light.position - x).normalized());
}

Rgb Light::Shooting(const Hierarchy& hierarchy, Index node, const Vec3& x) const {
  if (IsElement(node)) {
    return Shooting(node);
  }
  if (IsPunctual(node)) {
    return punctual[node - kFirstPunctual];
  }
  const Index cluster = node - kFirstCluster;
  const CosineSum towards = CosineBasis((x - hierarchy.clusters()[cluster].centre).normalized());
  return cluster_radiosity[cluster].Towards(towards, aperture[cluster]).max(0.0);
}

void PullCoefficients(const Hierarchy& hierarchy, const Basis& basis, std::span<const double> open, Index e,
                      std::span<Rgb> all) {
  const std::size_t count = basis.count();
  const Coefficients own = all.subspan(count * e, count);
  Rgb mean = own[0];
  const std::array<Rgb, kMostInBasis> flat = {mean,        Rgb::Zero(), Rgb::Zero(),
                                              Rgb::Zero(), Rgb::Zero(), Rgb::Zero()};
  std::ranges::fill(own, Rgb::Zero());
  const Index first = hierarchy[e].first_child;
  for (Index child = first; child < first + 4; ++child) {
    const ConstCoefficients below =
        open[child] > 0 ? ConstCoefficients(all.subspan(count * child, count)) : ConstCoefficients(flat);
    PullFrom(basis, child, hierarchy[child].area / hierarchy[e].area, below, own);
  }
  own[0] = mean;
}

void Light::Pull(const Hierarchy& hierarchy) {
  const std::size_t count = basis.count();
  for (std::size_t e = 0; count > 1 && e < radiosity.size(); ++e) {
    shooting_coefficients[count * e] = open[e] > 0 ? Rgb(radiosity[e] / open[e]) : Rgb::Zero();
  }
  // Children come after their parents.
  for (auto e = static_cast<Index>(radiosity.size()); e-- > 0;) {
    if (!hierarchy[e].IsLeaf()) {
      PullElement(hierarchy, e);
    }
  }
  PullClusters(hierarchy);
}

void Light::PullElement(const Hierarchy& hierarchy, Index e) {
  const Index first = hierarchy[e].first_child;
  double area = 0;
  double open_area = 0;
  Rgb power = Rgb::Zero();
  Rgb flux = Rgb::Zero();
  for (Index child = first; child < first + 4; ++child) {
    area += hierarchy[child].area;
    open_area += hierarchy[child].area * open[child];
    power += hierarchy[child].area * radiosity[child];
    flux += hierarchy[child].area * irradiance[child];
  }
  radiosity[e] = power / area;
  irradiance[e] = flux / area;
  if (basis.count() > 1) {
    shooting_coefficients[basis.count() * e] = open_area > 0 ? Rgb(power / open_area) : Rgb::Zero();
    PullCoefficients(hierarchy, basis, open, e, shooting_coefficients);
  }
  double variance = 0;
  for (Index child = first; child < first + 4; ++child) {
    if (open[child] > 0) {
      const double deviation = basis.count() > 1
                                   ? DeviationOfChild(e, child)
                                   : Luminance(radiosity[child]) / open[child] - Luminance(power) / open_area;
      const double within = variation[child];
      variance += hierarchy[child].area * open[child] / open_area * (deviation * deviation + within * within);
    }
  }
  variation[e] = std::sqrt(variance);
}

double Light::DeviationOfChild(Index parent, Index child) const {
  const std::size_t count = basis.count();
  std::array<Rgb, kMostInBasis> pushed;
  pushed.fill(Rgb::Zero());
  PushTo(basis, child, ShootingPolynomial(parent), pushed);
  double square = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const double difference = Luminance(shooting_coefficients[count * child + k] - pushed[k]);
    square += difference * difference;
  }
  return std::sqrt(square);
}

void Light::PullClusters(const Hierarchy& hierarchy) {
  const Clusters& clusters = hierarchy.clusters();
  std::vector<Rgb> shooting(clusters.empty() ? 0 : hierarchy.surface_root_count());
  for (Index patch = 0; patch < shooting.size(); ++patch) {
    shooting[patch] = Shooting(patch);
  }
  tbb::parallel_for(Index{0}, static_cast<Index>(clusters.size()), [&](Index c) {
    cluster_radiosity[c] = RadiosityOf(hierarchy, openness, c, shooting);
    const double mean = Luminance(cluster_radiosity[c].mean);
    double variance = 0;
    for (const Index patch : clusters.PatchesBelow(c)) {
      const double deviation = Luminance(shooting[patch]) - mean;
      variance += hierarchy[patch].area * (deviation * deviation + variation[patch] * variation[patch]);
    }
    cluster_variation[c] = std::sqrt(variance / clusters[c].area);
  });
}

void Light::PullOpen(const Hierarchy& hierarchy) {
  for (std::size_t e = hierarchy.size(); e-- > 0;) {
    const Element& element = hierarchy[static_cast<Index>(e)];
    if (!element.IsLeaf()) {
      double open_area = 0;
      double area = 0;
      for (Index child = element.first_child; child < element.first_child + 4; ++child) {
        open_area += hierarchy[child].area * open[child];
        area += hierarchy[child].area;
      }
      open[e] = open_area / area;
    }
  }
  constexpr double kMuch = 0.5;
  for (Index e = 0; e < hierarchy.size(); ++e) {
    const Index parent = hierarchy[e].parent;
    seen_as[e] = parent == kNone || open[e] >= kMuch || open[parent] == 0 ? e : seen_as[parent];
  }
  const Clusters& clusters = hierarchy.clusters();
  tbb::parallel_for(Index{0}, static_cast<Index>(aperture.size()), [&](Index c) {
    aperture[c].setZero();
    enclosed[c] = 0;
    for (const Index patch : clusters.PatchesBelow(c)) {
      const double share = hierarchy[patch].area / clusters[c].area * open[patch];
      aperture[c] +=
          static_cast<float>(share * openness.Share(patch, clusters[c].depth)) * clusters.BasisOf(patch);
      enclosed[c] += share * openness.Enclosed(patch, clusters[c].depth);
    }
  });
}

std::size_t Light::Bytes() const {
  return basis.Bytes() + BytesOf(radiosity) + BytesOf(irradiance) + BytesOf(variation) + BytesOf(open) +
         BytesOf(seen_as) + BytesOf(shooting_coefficients) + BytesOf(lighting_coefficients);
}

void Light::Extend(const Hierarchy& hierarchy) {
  const std::size_t count = basis.count();
  if (count > 1) {
    basis.Extend(hierarchy);
    const std::size_t known = shooting_coefficients.size() / count;
    // To the size and no further, as vectors grow by themselves: they are most of the memory.
    shooting_coefficients.reserve(count * hierarchy.size());
    lighting_coefficients.reserve(count * hierarchy.size());
    shooting_coefficients.resize(count * hierarchy.size(), Rgb::Zero());
    lighting_coefficients.resize(count * hierarchy.size(), Rgb::Zero());
    for (auto e = static_cast<Index>(known); e < hierarchy.size(); ++e) {
      const Coefficients own = std::span(shooting_coefficients).subspan(count * e, count);
      if (const Index parent = hierarchy[e].parent; parent == kNone) {
        own[0] = hierarchy.PatchOf(e).emission;
      } else {
        PushTo(basis, e, ShootingPolynomial(parent), own);
      }
    }
  }
  radiosity.reserve(hierarchy.size());
  irradiance.reserve(hierarchy.size());
  for (auto e = static_cast<Index>(radiosity.size()); e < hierarchy.size(); ++e) {
    const Index parent = hierarchy[e].parent;
    radiosity.push_back(parent == kNone ? hierarchy.PatchOf(e).emission : radiosity[parent]);
  }
  irradiance.resize(hierarchy.size(), Rgb::Zero());
  variation.resize(hierarchy.size(), 0.0);
  open.resize(hierarchy.size(), 1.0);
  while (seen_as.size() < hierarchy.size()) {
    seen_as.push_back(static_cast<Index>(seen_as.size()));
  }
  const std::size_t clusters = hierarchy.clusters().size();
  cluster_radiosity.resize(clusters);
  cluster_variation.resize(clusters, 0.0);
  aperture.resize(clusters, CosineSum::Zero());
  enclosed.resize(clusters, 0.0);
  if (punctual.empty()) {
    for (const PunctualLight& light : hierarchy.patches().lights) {
      punctual.push_back(light.intensity);
    }
  }
}

}  // namespace radbake
