#include "solver/scene/quadrature.h"

#include <cmath>

namespace radbake {

void Quadrature::AddTriangle(const Polygon& triangle, double a, double weight) {
  for (int k = 0; k < 3; ++k) {
    points_[count_++] = {(1 - 2 * a) * triangle[k] + a * (triangle[(k + 1) % 3] + triangle[(k + 2) % 3]),
                         weight};
  }
}

Quadrature::Quadrature(const Polygon& polygon, int degree) {
  if (degree == 0) {
    points_[count_++] = {polygon.Centroid(), 1};
    area_ = Area(polygon);
    return;
  }
  const Vec3 along_s = polygon[1] - polygon[0];
  const bool fine = degree > 2;
  if (polygon.count == 3) {
    area_ = 0.5 * along_s.cross(polygon[2] - polygon[0]).dot(polygon.normal);
    if (fine) {
      AddTriangle(polygon, 0.445948490915964886, 0.223381589678011466);
      AddTriangle(polygon, 0.091576213509770743, 0.109951743655321868);
    } else {
      AddTriangle(polygon, 1.0 / 6, 1.0 / 3);
    }
    return;
  }
  // Two or three points in each of the bilinear coordinates: of degree 3 or 5, the Jacobian included. It is
  // linear in both.
  const Vec3 along_t = polygon[3] - polygon[0];
  const Vec3 twist = polygon[2] - polygon[1] - along_t;
  const double jacobian = along_s.cross(along_t).dot(polygon.normal);
  const double in_s = along_s.cross(twist).dot(polygon.normal);
  const double in_t = twist.cross(along_t).dot(polygon.normal);
  static const double kTwo = std::sqrt(1.0 / 12);
  static const double kThree = std::sqrt(0.15);
  const double off = fine ? kThree : kTwo;
  const std::array<double, 3> node = {0.5 - off, 0.5 + off, 0.5};
  constexpr std::array<double, 3> kShare = {5.0 / 18, 5.0 / 18, 8.0 / 18};
  const std::size_t nodes = fine ? 3 : 2;
  for (std::size_t i = 0; i < nodes; ++i) {
    const double s = node[i];
    for (std::size_t j = 0; j < nodes; ++j) {
      const double t = node[j];
      const double weight = (fine ? kShare[i] * kShare[j] : 0.25) * (jacobian + s * in_s + t * in_t);
      points_[count_++] = {polygon[0] + s * along_s + t * (along_t + s * twist), weight};
      area_ += weight;
    }
  }
  for (QuadraturePoint& point : std::span(points_.data(), count_)) {
    point.weight = area_ > 0 ? point.weight / area_ : 1 / static_cast<double>(count_);
  }
}

}  // namespace radbake
