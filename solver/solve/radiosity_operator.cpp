#include "solver/solve/radiosity_operator.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <cmath>

namespace radbake {
namespace {

/// Children have higher indices than their parents.
void PullElements(const Hierarchy& hierarchy, Light& light) {
  for (auto e = static_cast<Index>(hierarchy.size()); e-- > 0;) {
    if (!hierarchy[e].IsLeaf()) {
      light.PullElement(hierarchy, e);
    }
  }
}

Eigen::Index Column(std::size_t leaf) {
  return static_cast<Eigen::Index>(leaf);
}

}  // namespace

RadiosityOperator::RadiosityOperator(const Hierarchy& hierarchy, const Rows& rows, const Light& light)
    : hierarchy_(hierarchy), rows_(rows), light_(light) {
  const std::size_t count = rows.leaves().size();
  emission_.resize(3, Column(count));
  reflectance_.resize(3, Column(count));
  areas_.resize(Column(count));
  from_lights_ = LeafValues::Zero(3, Column(count));
  for (std::size_t k = 0; k < count; ++k) {
    const Index leaf = rows.leaves()[k];
    // What a sealed part emits stays where it is: only the open one shoots.
    emission_.col(Column(k)) = light.open[leaf] * hierarchy.PatchOf(leaf).emission;
    reflectance_.col(Column(k)) = hierarchy.PatchOf(leaf).reflectance;
    areas_[Column(k)] = hierarchy.IsSky(leaf) ? 0 : hierarchy[leaf].area;
    for (const Gathered& entry : rows[k]) {
      if (IsPunctual(entry.shooter)) {
        from_lights_.col(Column(k)) +=
            static_cast<double>(entry.weight) * light.punctual[entry.shooter - kFirstPunctual];
      }
    }
  }
}

LeafValues RadiosityOperator::Radiosity(const Light& light) const {
  LeafValues radiosity(3, size());
  for (std::size_t k = 0; k < rows_.leaves().size(); ++k) {
    radiosity.col(Column(k)) = light.radiosity[rows_.leaves()[k]];
  }
  return radiosity;
}

LeafValues RadiosityOperator::Gather(const LeafValues& radiosity) const {
  Light shooting;
  shooting.open = light_.open;
  shooting.radiosity.assign(hierarchy_.size(), Rgb::Zero());
  shooting.irradiance = shooting.radiosity;
  shooting.variation.assign(hierarchy_.size(), 0);
  shooting.punctual.assign(light_.punctual.size(), Rgb::Zero());
  for (std::size_t k = 0; k < rows_.leaves().size(); ++k) {
    shooting.radiosity[rows_.leaves()[k]] = radiosity.col(Column(k));
  }
  PullElements(hierarchy_, shooting);

  std::vector<Rgb> by_element(hierarchy_.size());
  for (Index e = 0; e < hierarchy_.size(); ++e) {
    by_element[e] = shooting.Shooting(e);
  }
  LeafValues irradiance(3, size());
  constexpr std::size_t kGrain = 64;
  const std::size_t count = rows_.leaves().size();
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, kGrain), [&](const auto& range) {
    for (std::size_t k = range.begin(); k != range.end(); ++k) {
      const Vec3 centre = hierarchy_.Centre(rows_.leaves()[k]);
      Rgb sum = Rgb::Zero();
      for (const Gathered& entry : rows_[k]) {
        sum += static_cast<double>(entry.weight) *
               (IsElement(entry.shooter) ? by_element[entry.shooter]
                                         : shooting.Shooting(hierarchy_, entry.shooter, centre));
      }
      irradiance.col(Column(k)) = sum;
    }
  });
  return irradiance;
}

Rgb RadiosityOperator::Norm(const LeafValues& values) const {
  Rgb squares = Rgb::Zero();
  for (Eigen::Index k = 0; k < size(); ++k) {
    squares += areas_[k] * values.col(k).square();
  }
  return squares.sqrt();
}

void RadiosityOperator::Store(const LeafValues& irradiance, Light& light) const {
  for (std::size_t k = 0; k < rows_.leaves().size(); ++k) {
    const Index leaf = rows_.leaves()[k];
    light.irradiance[leaf] = irradiance.col(Column(k));
    light.radiosity[leaf] =
        emission_.col(Column(k)) + reflectance_.col(Column(k)) * irradiance.col(Column(k));
    light.variation[leaf] = 0;
  }
  PullElements(hierarchy_, light);
}

}  // namespace radbake
