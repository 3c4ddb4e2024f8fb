#include "solver/transport/coupling.h"

#include <algorithm>

#include "solver/transport/form_factor.h"

namespace radbake {

BasisEnd::BasisEnd(const Hierarchy& hierarchy, const Basis& basis, Index element)
    : shape(hierarchy.Shape(element)),
      area(hierarchy[element].area),
      rule(shape, ProductDegree(basis.count())) {
  for (std::size_t q = 0; q < rule.points().size(); ++q) {
    values[q] = basis.At(element, rule.points()[q].x);
  }
}

BasisValues SeenFrom(const Vec3& x, const Vec3& n, const BasisEnd& shooter) {
  BasisValues sums{};
  for (std::size_t q = 0; q < shooter.rule.points().size(); ++q) {
    const QuadraturePoint& point = shooter.rule.points()[q];
    const Vec3 along = point.x - x;
    const double out = along.dot(n);
    const double in = -along.dot(shooter.shape.normal);
    if (out > 0 && in > 0) {
      const double r2 = along.squaredNorm();
      const double kernel = point.weight * out * in / (r2 * r2);
      for (std::size_t k = 0; k < sums.size(); ++k) {
        sums[k] += kernel * shooter.values[q][k];
      }
    }
  }
  if (!(sums[0] > 0)) {
    return {1};
  }
  for (std::size_t k = 1; k < sums.size(); ++k) {
    sums[k] /= sums[0];
  }
  sums[0] = 1;
  return sums;
}

void CoupleShaped(const BasisEnd& receiver, const BasisEnd& shooter, std::size_t count,
                  std::span<float> couplings) {
  std::ranges::fill(couplings, 0.0F);
  const BasisValues back = MomentsOver(
      shooter, [&](const Vec3& y) { return PointToPolygon(y, shooter.shape.normal, receiver.shape); });
  for (std::size_t j = 1; j < count; ++j) {
    couplings[j - 1] = static_cast<float>(shooter.area / receiver.area * back[j]);
  }
  for (std::size_t q = 0; q < receiver.rule.points().size(); ++q) {
    const QuadraturePoint& point = receiver.rule.points()[q];
    const double form_factor = point.weight * PointToPolygon(point.x, receiver.shape.normal, shooter.shape);
    if (!(form_factor > 0)) {
      continue;
    }
    const BasisValues seen = SeenFrom(point.x, receiver.shape.normal, shooter);
    for (std::size_t i = 1; i < count; ++i) {
      for (std::size_t j = 1; j < count; ++j) {
        couplings[(count - 1) * i + j - 1] +=
            static_cast<float>(form_factor * receiver.values[q][i] * seen[j]);
      }
    }
  }
}

}  // namespace radbake
