#include "solver/scene/quadrature.h"

#include <cmath>

namespace radbake {

void Quadrature::AddTriangle(const Polygon& triangle, double a, double weight) {
  const Vec3 common = a * (triangle[0] + triangle[1] + triangle[2]);
  for (int k = 0; k < 3; ++k) {
    points_[count_++] = {common + (1 - 3 * a) * triangle[k], weight};
  }
}

template <std::size_t N>
void Quadrature::AddQuadrilateral(const Polygon& polygon, const std::array<double, N>& node,
                                  const std::array<double, N>& share) {
  // In each of the bilinear coordinates: of degree 2·N − 1, the Jacobian included. It is linear in both, and
  // constant on parallelograms.
  const Vec3 along_s = polygon[1] - polygon[0];
  const Vec3 along_t = polygon[3] - polygon[0];
  const Vec3 twist = polygon[2] - polygon[1] - along_t;
  area_ = along_s.cross(along_t).dot(polygon.normal);
  constexpr double kParallel = 1e-24;  // of rounding, squared
  const bool parallel = twist.squaredNorm() <= kParallel * (along_s.squaredNorm() + along_t.squaredNorm());
  for (std::size_t i = 0; i < N; ++i) {
    const Vec3 from = polygon[0] + node[i] * along_s;
    const Vec3 along = along_t + node[i] * twist;
    for (std::size_t j = 0; j < N; ++j) {
      points_[count_++] = {from + node[j] * along, share[i] * share[j]};
    }
  }
  if (parallel) {
    return;
  }
  const double jacobian = area_;
  const double in_s = along_s.cross(twist).dot(polygon.normal);
  const double in_t = twist.cross(along_t).dot(polygon.normal);
  area_ = jacobian + 0.5 * (in_s + in_t);
  if (!(area_ > 0)) {
    return;
  }
  for (std::size_t i = 0; i < N; ++i) {
    for (std::size_t j = 0; j < N; ++j) {
      points_[N * i + j].weight *= (jacobian + node[i] * in_s + node[j] * in_t) / area_;
    }
  }
}

Quadrature::Quadrature(const Polygon& polygon, int degree) {
  if (degree == 0) {
    points_[count_++] = {polygon.Centroid(), 1};
    area_ = Area(polygon);
    return;
  }
  const bool fine = degree > 2;
  if (polygon.count == 4) {
    static const double kTwo = std::sqrt(1.0 / 12);
    static const double kThree = std::sqrt(0.15);
    if (fine) {
      AddQuadrilateral<3>(polygon, {0.5 - kThree, 0.5 + kThree, 0.5}, {5.0 / 18, 5.0 / 18, 8.0 / 18});
    } else {
      AddQuadrilateral<2>(polygon, {0.5 - kTwo, 0.5 + kTwo}, {0.5, 0.5});
    }
    return;
  }
  area_ = 0.5 * (polygon[1] - polygon[0]).cross(polygon[2] - polygon[0]).dot(polygon.normal);
  if (fine) {
    AddTriangle(polygon, 0.445948490915964886, 0.223381589678011466);
    AddTriangle(polygon, 0.091576213509770743, 0.109951743655321868);
  } else {
    AddTriangle(polygon, 1.0 / 6, 1.0 / 3);
  }
}

}  // namespace radbake
