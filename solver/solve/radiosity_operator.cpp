#include "solver/solve/radiosity_operator.h"

#include <oneapi/tbb/parallel_for.h>

#include <cmath>

namespace radbake {
namespace {

/// Squared norms of the leaves below one node, by area.
struct Norms {
  double change = 0;
  double radiosity = 0;
};

class PushPull {
 public:
  PushPull(const Hierarchy& hierarchy, const std::vector<Rgb>& gathered, Light& light)
      : hierarchy_(hierarchy), gathered_(gathered), light_(light) {}

  Norms Visit(Index e) {
    const Element& element = hierarchy_[e];
    Norms norms;
    if (element.IsLeaf()) {
      const Patch& patch = hierarchy_.PatchOf(e);
      const Rgb& irradiance = gathered_[e];
      const Rgb radiosity = patch.emission + patch.reflectance * irradiance;
      norms.change = element.area * (radiosity - light_.radiosity[e]).square().sum();
      norms.radiosity = element.area * radiosity.square().sum();
      light_.radiosity[e] = radiosity;
      light_.irradiance[e] = irradiance;
      light_.variation[e] = 0;
      return norms;
    }
    const Index first = element.first_child;
    double area = 0;
    double open_area = 0;
    for (Index child = first; child < first + 4; ++child) {
      area += hierarchy_[child].area;
      open_area += hierarchy_[child].area * light_.open[child];
    }
    Rgb radiosity = Rgb::Zero();
    Rgb mean_irradiance = Rgb::Zero();
    for (Index child = first; child < first + 4; ++child) {
      const Norms below = Visit(child);
      norms.change += below.change;
      norms.radiosity += below.radiosity;
      radiosity += hierarchy_[child].area * light_.radiosity[child];
      mean_irradiance += hierarchy_[child].area * light_.irradiance[child];
    }
    light_.radiosity[e] = radiosity / area;
    light_.irradiance[e] = mean_irradiance / area;
    light_.variation[e] = Variation(first, open_area, Luminance(radiosity));
    return norms;
  }

 private:
  /// `power` = Σ A·B of the children.
  double Variation(Index first, double open_area, double power) const {
    double variance = 0;
    for (Index child = first; child < first + 4; ++child) {
      const double open = light_.open[child];
      if (open > 0) {
        const double deviation = Luminance(light_.radiosity[child]) / open - power / open_area;
        const double within = light_.variation[child];
        variance += hierarchy_[child].area * open / open_area * (deviation * deviation + within * within);
      }
    }
    return std::sqrt(variance);
  }

  const Hierarchy& hierarchy_;
  const std::vector<Rgb>& gathered_;
  Light& light_;
};

}  // namespace

double ApplyRadiosityOperator(const Hierarchy& hierarchy, const Rows& rows, Light& light) {
  std::vector<Rgb> gathered(hierarchy.size());
  tbb::parallel_for(std::size_t{0}, rows.leaves().size(), [&](std::size_t k) {
    Rgb sum = Rgb::Zero();
    for (const Gathered& entry : rows[k]) {
      sum += static_cast<double>(entry.weight) *
             light.Shooting(hierarchy, entry.shooter, hierarchy.Centre(rows.leaves()[k]));
    }
    gathered[rows.leaves()[k]] = sum;
  });
  std::vector<Norms> norms(hierarchy.root_count());
  tbb::parallel_for(std::size_t{0}, norms.size(), [&](std::size_t root) {
    norms[root] = PushPull(hierarchy, gathered, light).Visit(static_cast<Index>(root));
  });
  Norms total;
  for (const Norms& part : norms) {
    total.change += part.change;
    total.radiosity += part.radiosity;
  }
  return total.radiosity > 0 ? std::sqrt(total.change / total.radiosity) : 0;
}

}  // namespace radbake
