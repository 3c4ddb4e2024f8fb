#include "solver/hierarchy/light.h"

#include <cmath>

namespace radbake {

Rgb Light::Shooting(const Hierarchy& hierarchy, Index node, const Vec3& x) const {
  if (IsElement(node)) {
    return Shooting(node);
  }
  if (IsPunctual(node)) {
    return punctual[node - kFirstPunctual];
  }
  // A ratio of two sums of cosines over the same patches: the errors of the basis all but cancel, unless
  // hardly anything is seen.
  constexpr double kHardly = 0.02;
  const Index cluster = node - kFirstCluster;
  const CosineSum basis = CosineBasis((x - hierarchy.clusters()[cluster].centre).normalized());
  const double seen = Evaluate(hierarchy.clusters()[cluster].extent, basis);
  return seen > kHardly ? Rgb(Evaluate(clusters[cluster].radiosity, basis).max(0.0) / seen)
                        : clusters[cluster].mean;
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
  double variance = 0;
  for (Index child = first; child < first + 4; ++child) {
    if (open[child] > 0) {
      const double deviation = Luminance(radiosity[child]) / open[child] - Luminance(power) / open_area;
      const double within = variation[child];
      variance += hierarchy[child].area * open[child] / open_area * (deviation * deviation + within * within);
    }
  }
  variation[e] = std::sqrt(variance);
}

void Light::PullCluster(const Hierarchy& hierarchy, Index c) {
  ClusterLight& light = clusters[c];
  const double area = hierarchy.clusters()[c].area;
  light.radiosity.setZero();
  light.mean.setZero();
  double square = 0;
  for (const Index child : hierarchy.clusters().Children(c)) {
    Rgb mean;
    double within = 0;
    double share = 0;
    if (IsCluster(child)) {
      const ClusterLight& below = clusters[child - kFirstCluster];
      share = hierarchy.clusters()[child - kFirstCluster].area / area;
      light.radiosity += static_cast<float>(share) * below.radiosity;
      mean = below.mean;
      within = below.variation;
    } else {
      share = hierarchy[child].area / area;
      mean = Shooting(child);
      light.radiosity +=
          ((static_cast<float>(share) * CosineBasis(hierarchy.PatchOf(child).normal)).matrix() *
           mean.cast<float>().matrix().transpose())
              .array();
      within = variation[child];
    }
    light.mean += share * mean;
    square += share * (std::pow(Luminance(mean), 2) + within * within);
  }
  light.variation = std::sqrt(std::max(0.0, square - std::pow(Luminance(light.mean), 2)));
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
  for (std::size_t k = clusters.size(); k-- > 0;) {
    const auto c = static_cast<Index>(k);
    clusters[c].aperture.setZero();
    for (const Index child : hierarchy.clusters().Children(c)) {
      const double area =
          IsCluster(child) ? hierarchy.clusters()[child - kFirstCluster].area : hierarchy[child].area;
      const auto share = static_cast<float>(area / hierarchy.clusters()[c].area);
      clusters[c].aperture += IsCluster(child) ? CosineSum(share * clusters[child - kFirstCluster].aperture)
                                               : CosineSum(share * static_cast<float>(open[child]) *
                                                           CosineBasis(hierarchy.PatchOf(child).normal));
    }
  }
}

void Light::Extend(const Hierarchy& hierarchy) {
  radiosity.reserve(hierarchy.size());
  for (auto e = static_cast<Index>(radiosity.size()); e < hierarchy.size(); ++e) {
    const Index parent = hierarchy[e].parent;
    radiosity.push_back(parent == kNone ? hierarchy.PatchOf(e).emission : radiosity[parent]);
  }
  irradiance.resize(hierarchy.size(), Rgb::Zero());
  variation.resize(hierarchy.size(), 0.0);
  open.resize(hierarchy.size(), 1.0);
  clusters.resize(hierarchy.clusters().size());
  if (punctual.empty()) {
    for (const PunctualLight& light : hierarchy.patches().lights) {
      punctual.push_back(light.intensity);
    }
  }
}

}  // namespace radbake
