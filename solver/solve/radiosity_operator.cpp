#include "solver/solve/radiosity_operator.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <cmath>

namespace radbake {
namespace {

/// Calls `visit` with every node that is no leaf, children before their parents, which come first in the
/// hierarchy.
template <typename Visit>
void ForEachParent(const Hierarchy& hierarchy, const Visit& visit) {
  for (auto e = static_cast<Index>(hierarchy.size()); e-- > 0;) {
    if (!hierarchy[e].IsLeaf()) {
      visit(e, hierarchy[e].first_child);
    }
  }
}

/// Calls `visit` with a node and all elements below it.
template <typename Visit>
void ForEachWithin(const Hierarchy& hierarchy, Index e, const Visit& visit) {
  visit(e);
  if (!hierarchy[e].IsLeaf()) {
    for (Index child = hierarchy[e].first_child; child < hierarchy[e].first_child + 4; ++child) {
      ForEachWithin(hierarchy, child, visit);
    }
  }
}

}  // namespace

RadiosityOperator::RadiosityOperator(const Hierarchy& hierarchy, const Links& links, const Rows& rows,
                                     const Couplings& couplings, const Light& light)
    : hierarchy_(hierarchy),
      links_(links),
      rows_(rows),
      couplings_(couplings),
      light_(light),
      count_(light.basis.count()),
      push_(hierarchy, links, light) {
  const std::size_t leaves = rows.leaves().size();
  emission_ = LeafValues::Zero(3, Column(leaves));
  reflectance_.resize(3, Column(leaves));
  areas_.resize(Column(leaves));
  for (std::size_t k = 0; k < leaves; ++k) {
    const Index leaf = rows.leaves()[k];
    // What a sealed part emits stays where it is: only the open one shoots.
    emission_.col(Column(k)) = light.open[leaf] * hierarchy.PatchOf(leaf).emission;
    for (Eigen::Index column = Column(k); column < Column(k + 1); ++column) {
      reflectance_.col(column) = hierarchy.PatchOf(leaf).reflectance;
      areas_[column] = hierarchy[leaf].area;
    }
  }
  bounds_ = Eigen::ArrayXd::Ones(size());
  if (!hierarchy.clusters().empty()) {
    BalancePush();
  }
  distant_ = Collect(Distant());
  emission_ += reflectance_ * distant_;
}

LeafValues RadiosityOperator::Radiosity(const Light& light) const {
  LeafValues radiosity = LeafValues::Zero(3, size());
  for (std::size_t k = 0; k < rows_.leaves().size(); ++k) {
    const Index leaf = rows_.leaves()[k];
    radiosity.col(Column(k)) = light.radiosity[leaf];
    for (std::size_t i = 1; i < count_ && light.open[leaf] == 1; ++i) {
      radiosity.col(Column(k) + static_cast<Eigen::Index>(i)) =
          light.shooting_coefficients[count_ * leaf + i];
    }
  }
  return radiosity;
}

SolveBytes RadiosityOperator::BytesNeeded(const Hierarchy& hierarchy, const Links& links, const Rows& rows,
                                          std::size_t count) {
  constexpr std::size_t kOfColumn = 3 * sizeof(Rgb) + 2 * sizeof(double);
  const std::size_t polynomials = count > 1 ? 2 * count : 0;  // of what shoots, and of what is gathered
  return {.elements =
              kOfColumn * count * rows.leaves().size() + (1 + polynomials) * hierarchy.size() * sizeof(Rgb),
          .links = hierarchy.clusters().empty()
                       ? 0
                       : links.size() * sizeof(Rgb) + ClusterPush::BytesNeeded(hierarchy, links)};
}

Shooters RadiosityOperator::Distant() const {
  Shooters shooters;
  shooters.elements.assign(hierarchy_.size(), Rgb::Zero());
  for (Index e = 0; e < hierarchy_.size(); ++e) {
    if (hierarchy_.IsSky(e)) {
      shooters.elements[e] = hierarchy_.PatchOf(e).emission;
    }
  }
  shooters.clusters = ShootingOfClusters(std::vector<Rgb>(hierarchy_.size(), Rgb::Zero()));
  shooters.punctual = light_.punctual;
  return shooters;
}

Shooters RadiosityOperator::Surfaces(const LeafValues& radiosity) const {
  Shooters shooters;
  std::vector<Rgb>& elements = shooters.elements;
  elements.assign(hierarchy_.size(), Rgb::Zero());
  for (std::size_t k = 0; k < rows_.leaves().size(); ++k) {
    const Rgb value = radiosity.col(Column(k));
    ForEachWithin(hierarchy_, rows_.leaves()[k], [&](Index e) { elements[e] = value; });
  }
  ForEachParent(hierarchy_, [&](Index e, Index first) {
    double area = 0;
    Rgb power = Rgb::Zero();
    for (Index child = first; child < first + 4; ++child) {
      power += hierarchy_[child].area * elements[child];
      area += hierarchy_[child].area;
    }
    elements[e] = power / area;
  });
  for (std::size_t e = 0; e < elements.size(); ++e) {
    const double open = light_.open[e];
    elements[e] = open > 0 ? Rgb(elements[e] / open) : Rgb::Zero();
  }
  if (count_ > 1) {
    std::vector<Rgb>& coefficients = shooters.coefficients;
    coefficients.assign(count_ * hierarchy_.size(), Rgb::Zero());
    for (std::size_t e = 0; e < elements.size(); ++e) {
      coefficients[count_ * e] = elements[e];
    }
    for (std::size_t k = 0; k < rows_.leaves().size(); ++k) {
      for (std::size_t i = 1; i < count_; ++i) {
        coefficients[count_ * rows_.leaves()[k] + i] =
            radiosity.col(Column(k) + static_cast<Eigen::Index>(i));
      }
    }
    ForEachParent(hierarchy_, [&](Index e, Index /*first*/) {
      PullCoefficients(hierarchy_, light_.basis, light_.open, e, coefficients);
    });
  }
  shooters.clusters = ShootingOfClusters(elements);
  shooters.punctual.assign(light_.punctual.size(), Rgb::Zero());
  return shooters;
}

std::vector<Rgb> RadiosityOperator::ShootingOfClusters(const std::vector<Rgb>& elements) const {
  const Clusters& clusters = hierarchy_.clusters();
  std::vector<Rgb> means(clusters.size(), Rgb::Zero());
  for (auto c = static_cast<Index>(means.size()); c-- > 0;) {
    for (const Index child : clusters.Children(c)) {
      means[c] += hierarchy_.Area(child) / clusters[c].area *
                  (IsCluster(child) ? means[child - kFirstCluster] : elements[child]);
    }
  }
  const std::span<const Link> links = links_.all();
  std::vector<Rgb> shooting(clusters.empty() ? 0 : links.size(), Rgb::Zero());
  tbb::parallel_for(std::size_t{0}, shooting.size(), [&](std::size_t k) {
    if (IsCluster(links[k].shooter)) {
      const std::span<const PatchShare> sources = links_.SourcesOf(links[k]);
      for (const PatchShare& source : sources) {
        shooting[k] += static_cast<double>(source.share) * elements[source.patch];
      }
      if (sources.empty()) {
        shooting[k] = means[links[k].shooter - kFirstCluster];
      }
    }
  });
  return shooting;
}

std::vector<Rgb> RadiosityOperator::CollectShaped(const Shooters& shooters) const {
  if (shooters.coefficients.empty()) {
    return {};
  }
  std::vector<Rgb> shaped(count_ * hierarchy_.size(), Rgb::Zero());
  const auto own = [&](Index e) { return std::span(shaped).subspan(count_ * e, count_); };
  tbb::parallel_for(Index{0}, static_cast<Index>(hierarchy_.size()),
                    [&](Index e) { couplings_.Gather(links_, e, shooters.coefficients, own(e)); });
  for (Index e = 0; e < hierarchy_.size(); ++e) {
    if (const Index parent = hierarchy_[e].parent; parent != kNone) {
      PushTo(light_.basis, e, own(parent), own(e));
    }
  }
  return shaped;
}

LeafValues RadiosityOperator::Collect(const Shooters& shooters) const {
  const std::vector<Rgb> from_clusters = push_.Push(shooters);
  const std::vector<Rgb> shaped = CollectShaped(shooters);
  LeafValues irradiance(3, size());
  constexpr std::size_t kGrain = 64;
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, rows_.leaves().size(), kGrain),
                    [&](const auto& range) {
                      for (std::size_t k = range.begin(); k != range.end(); ++k) {
                        const Index leaf = rows_.leaves()[k];
                        const Index patch = hierarchy_[leaf].patch;
                        // What a patch gathers falls on its open parts alone.
                        Rgb sum = Rgb::Zero();
                        if (light_.open[patch] > 0) {
                          sum = light_.open[leaf] / light_.open[patch] * from_clusters[patch];
                        }
                        std::array<Rgb, kMostInBasis> moments;
                        moments.fill(Rgb::Zero());
                        const float* moment = rows_.Moments(k).data();
                        for (const Gathered& entry : rows_[k]) {
                          const Rgb& shooting = shooters.Of(entry.shooter);
                          sum += static_cast<double>(entry.weight) * shooting;
                          for (std::size_t i = 1; i < count_; ++i) {
                            moments[i] += static_cast<double>(*moment++) * shooting;
                          }
                        }
                        if (!shaped.empty()) {
                          sum += light_.open[leaf] * shaped[count_ * leaf];
                          for (std::size_t i = 1; i < count_ && light_.open[leaf] == 1; ++i) {
                            moments[i] += shaped[count_ * leaf + i];
                          }
                        }
                        irradiance.col(Column(k)) = sum;
                        for (std::size_t i = 1; i < count_; ++i) {
                          irradiance.col(Column(k) + static_cast<Eigen::Index>(i)) = moments[i];
                        }
                      }
                    });
  return irradiance;
}

LeafValues RadiosityOperator::EvenLight() const {
  LeafValues even = LeafValues::Zero(3, size());
  for (std::size_t k = 0; k < rows_.leaves().size(); ++k) {
    even.col(Column(k)) = light_.open[rows_.leaves()[k]];
  }
  return even;
}

void RadiosityOperator::BalancePush() {
  Shooters even = Surfaces(EvenLight());
  for (Index e = 0; e < hierarchy_.size(); ++e) {
    if (hierarchy_.IsSky(e)) {
      even.elements[e] = Rgb::Ones();
    }
  }
  const LeafValues irradiance = Collect(even);
  std::vector<double> seen(hierarchy_.surface_root_count());
  for (Eigen::Index k = 0; k < size(); ++k) {
    if (IsMean(k)) {
      seen[PatchOf(k)] += areas_[k] / hierarchy_[PatchOf(k)].area * irradiance(0, k);
    }
  }
  push_.Balance(even, seen);
}

LeafValues RadiosityOperator::Gather(const LeafValues& radiosity) const {
  return Collect(Surfaces(radiosity)).rowwise() * bounds_.transpose();
}

LeafValues RadiosityOperator::LocalMeans(const LeafValues& values) const {
  Eigen::Array3Xd sums = Eigen::Array3Xd::Zero(3, Column(hierarchy_.root_count()));
  for (Eigen::Index k = 0; k < size(); ++k) {
    if (IsMean(k)) {
      sums.col(PatchOf(k)) += areas_[k] * values.col(k).abs();
    }
  }
  const Clusters& clusters = hierarchy_.clusters();
  Eigen::Array3Xd of_clusters = Eigen::Array3Xd::Zero(3, Column(clusters.size()));
  for (Index c = 0; c < clusters.size(); ++c) {
    for (const Index patch : clusters.PatchesBelow(c)) {
      of_clusters.col(c) += sums.col(patch);
    }
    of_clusters.col(c) /= clusters[c].area;
  }
  LeafValues means(3, size());
  for (Eigen::Index k = 0; k < size(); ++k) {
    const Index patch = PatchOf(k);
    means.col(k) = clusters.empty() ? Rgb(sums.col(patch) / hierarchy_[patch].area)
                                    : Rgb(of_clusters.col(clusters.Above(patch)));
  }
  return means;
}

Rgb RadiosityOperator::RelativeRms(const LeafValues& values, const LeafValues& measures) const {
  Rgb squares = Rgb::Zero();
  Rgb area = Rgb::Zero();
  for (Eigen::Index k = 0; k < size(); ++k) {
    const Rgb measure = measures.col(k);
    squares += (measure > 0).select(areas_[k] * (values.col(k) / measure).square(), 0.0);
    if (IsMean(k)) {
      area += (measure > 0).select(areas_[k], Rgb::Zero());
    }
  }
  return (area > 0).select((squares / area).sqrt(), 0.0);
}

bool RadiosityOperator::Grows(const Light& light) const {
  // What is uncertain in many links together is less.
  constexpr double kMost = 1.05;
  Rgb kept = Rgb::Zero();
  Rgb given = Rgb::Zero();
  for (std::size_t k = 0; k < rows_.leaves().size(); ++k) {
    const Eigen::Index mean = Column(k);
    const Rgb reflectance = reflectance_.col(mean);
    const Rgb distant = distant_.col(mean);
    kept += areas_[mean] * (1 - reflectance) * light.irradiance[rows_.leaves()[k]];
    given += areas_[mean] * (emission_.col(mean) + (1 - reflectance) * distant);
  }
  return (kept > kMost * given).any();
}

void RadiosityOperator::Bound() {
  const LeafValues sums = Gather(EvenLight());
  for (std::size_t k = 0; k < rows_.leaves().size(); ++k) {
    const double sum = sums(0, Column(k));
    if (reflectance_.col(Column(k)).maxCoeff() * sum > 1) {
      bounds_.segment(Column(k), static_cast<Eigen::Index>(count_)) /= sum;
    }
  }
}

void RadiosityOperator::StoreShape(std::size_t k, const LeafValues& irradiance, Light& light) const {
  const Index leaf = rows_.leaves()[k];
  const Coefficients own = std::span(light.lighting_coefficients).subspan(count_ * leaf, count_);
  own[0] = light.irradiance[leaf];
  for (std::size_t i = 1; i < count_; ++i) {
    const Eigen::Index column = Column(k) + static_cast<Eigen::Index>(i);
    own[i] = irradiance.col(column) + distant_.col(column);
  }
  KeepPositive(light.basis[leaf], hierarchy_.Shape(leaf), own);
  for (std::size_t i = 1; i < count_; ++i) {
    light.shooting_coefficients[count_ * leaf + i] = hierarchy_.PatchOf(leaf).reflectance * own[i];
  }
}

void RadiosityOperator::Store(const LeafValues& irradiance, Light& light) const {
  for (std::size_t k = 0; k < rows_.leaves().size(); ++k) {
    const Index leaf = rows_.leaves()[k];
    const Rgb e = (irradiance.col(Column(k)) + distant_.col(Column(k))).max(0.0);
    const Rgb reflected = reflectance_.col(Column(k)) * e;
    ForEachWithin(hierarchy_, leaf, [&](Index element) {
      light.irradiance[element] = e;
      light.radiosity[element] = light.open[element] * hierarchy_.PatchOf(leaf).emission + reflected;
      light.variation[element] = 0;
    });
    if (count_ > 1) {
      StoreShape(k, irradiance, light);
    }
  }
  light.Pull(hierarchy_);
}

}  // namespace radbake
