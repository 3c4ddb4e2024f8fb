#include "solver/bake/element_centre.h"

namespace radbake {

Vec3 ElementCentre(const Polygon& shape) {
  const std::array<float, 4> weight = CentreWeights(shape.count);
  Vec3 centre = Vec3::Zero();
  for (int k = 0; k < shape.count; ++k) {
    centre += static_cast<double>(weight[static_cast<std::size_t>(k)]) * shape[k];
  }
  return centre;
}

Vec3 InsideNear(const Hierarchy& hierarchy, Index element, const Vec3& x) {
  constexpr double kHair = 1e-4;
  const Polygon shape = hierarchy.Shape(element);
  return x + kHair * (0.5 * ElementCentre(shape) + 0.3 * shape[0] + 0.2 * shape[1] - x);
}

}  // namespace radbake
