#include "solver/transport/sampling.h"

#include <numbers>

namespace radbake {

Vec3 Around(const Vec3& axis, double cosine, double v) {
  const double sine = std::sqrt(std::max(0.0, 1 - cosine * cosine));
  const double angle = 2 * std::numbers::pi * v;
  const Vec3 tangent = axis.unitOrthogonal();
  return sine * (std::cos(angle) * tangent + std::sin(angle) * axis.cross(tangent)) + cosine * axis;
}

PointsOn::PointsOn(const Polygon& polygon) : polygon_(polygon) {
  for (int k = 0; k + 2 < polygon.count; ++k) {
    const Vec3 a = polygon[k + 1] - polygon[0];
    const Vec3 b = polygon[k + 2] - polygon[0];
    const double area = std::abs(polygon.normal.dot(a.cross(b)));
    area_[static_cast<std::size_t>(k)] = area;
    total_ += area;
  }
}

Vec3 PointsOn::operator()(double u, double v) const {
  // The triangle of the fan that holds the share u of the area, and u stretched over it.
  double share = u * total_;
  int chosen = 0;
  while (chosen + 3 < polygon_.count && share >= area_[static_cast<std::size_t>(chosen)]) {
    share -= area_[static_cast<std::size_t>(chosen++)];
  }
  const double size = area_[static_cast<std::size_t>(chosen)];
  const double s = std::sqrt(size > 0 ? std::min(1.0, share / size) : 0.0);
  return polygon_[0] * (1 - s) + polygon_[chosen + 1] * (s * (1 - v)) + polygon_[chosen + 2] * (s * v);
}

}  // namespace radbake
