#include "solver/bake/mesh_light.h"

#include <algorithm>
#include <utility>

#include "solver/bake/element_centre.h"
#include "solver/bake/surroundings.h"

namespace radbake {
namespace {

/// Of those corners that somebody sees.
Rgb Interpolate(const std::array<double, 3>& weight, const std::array<Rgb, 3>& irradiance) {
  Rgb sum = Rgb::Zero();
  double seen = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    if (!irradiance[k].isNaN().any()) {
      sum += weight[k] * irradiance[k];
      seen += weight[k];
    }
  }
  return seen > 0 ? Rgb(sum / seen) : Rgb::Zero();
}

}  // namespace

MeshLight::MeshLight(const Hierarchy& hierarchy, std::span<const Index> cut, std::vector<Rgb> at_vertex,
                     std::vector<Rgb> at_centre)
    : hierarchy_(hierarchy),
      at_vertex_(std::move(at_vertex)),
      at_centre_(std::move(at_centre)),
      in_cut_(hierarchy.size(), kNone) {
  for (std::size_t k = 0; k < cut.size(); ++k) {
    in_cut_[cut[k]] = static_cast<Index>(k);
  }
}

Index MeshLight::ElementAt(Index patch, const Vec3& y) const {
  Index element = patch;
  while (in_cut_[element] == kNone) {
    element = hierarchy_.ChildAt(element, y);
  }
  return element;
}

Rgb MeshLight::At(Index patch, const Vec3& y) const {
  const Index element = ElementAt(patch, y);
  const Polygon shape = hierarchy_.Shape(element);
  const Vec3 centre = ElementCentre(shape);
  // The triangle of the fan that holds the point: that to the left of its first edge from the centre and to
  // the right of its second.
  std::array<double, 4> left{};
  for (int k = 0; k < shape.count; ++k) {
    left[static_cast<std::size_t>(k)] = shape.normal.dot((shape[k] - centre).cross(y - centre));
  }
  std::array<double, 3> weight = {1, 0, 0};
  int found = 0;
  for (int k = 0; k < shape.count; ++k) {
    const int next = (k + 1) % shape.count;
    const double of_next = left[static_cast<std::size_t>(k)];
    const double of_this = -left[static_cast<std::size_t>(next)];
    if (of_next >= 0 && of_this >= 0) {
      const double whole = shape.normal.dot((shape[k] - centre).cross(shape[next] - centre));
      const double within = std::max(whole, of_next + of_this);
      found = k;
      if (within > 0) {
        weight = {1 - (of_next + of_this) / within, of_this / within, of_next / within};
      }
      break;
    }
  }
  const auto& corner = hierarchy_[element].corner;
  const Rgb& at_centre = at_centre_[in_cut_[element]];
  const Rgb linear =
      Interpolate(weight, {at_centre, at_vertex_[corner[static_cast<std::size_t>(found)]],
                           at_vertex_[corner[static_cast<std::size_t>((found + 1) % shape.count)]]});
  // Where irradiance is curved, so much more that its mean over the element is right for any quadratic one.
  Rgb bulge = at_centre;
  for (std::size_t k = 0; k < static_cast<std::size_t>(shape.count); ++k) {
    bulge -= at_vertex_[corner[k]] / shape.count;
  }
  const double share = shape.count == 4 ? 1.0 / 3 : 5.0 / 12;
  return bulge.isNaN().any() ? linear : Rgb((linear + share * bulge).max(0.0));
}

}  // namespace radbake
