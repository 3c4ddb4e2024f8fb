#include "solver/transport/sampling.h"

#include <numbers>

namespace radbake {

Vec3 Around(const Vec3& axis, double cosine, double v) {
  const double sine = std::sqrt(std::max(0.0, 1 - cosine * cosine));
  const double angle = 2 * std::numbers::pi * v;
  const Vec3 tangent = axis.unitOrthogonal();
  return sine * (std::cos(angle) * tangent + std::sin(angle) * axis.cross(tangent)) + cosine * axis;
}

Vec3 PointOn(const Polygon& polygon, double u, double v) {
  // The triangle of the fan that holds the share u of the area, and u stretched over it.
  std::array<double, 5> area{};
  double total = 0;
  const int triangles = polygon.count - 2;
  for (int k = 0; k < triangles; ++k) {
    const Vec3 a = polygon[k + 1] - polygon[0];
    const Vec3 b = polygon[k + 2] - polygon[0];
    area[static_cast<std::size_t>(k)] = a.cross(b).norm();
    total += area[static_cast<std::size_t>(k)];
  }
  double share = u * total;
  int chosen = 0;
  while (chosen + 1 < triangles && share >= area[static_cast<std::size_t>(chosen)]) {
    share -= area[static_cast<std::size_t>(chosen++)];
  }
  const double size = area[static_cast<std::size_t>(chosen)];
  const double s = std::sqrt(size > 0 ? std::min(1.0, share / size) : 0.0);
  return polygon[0] * (1 - s) + polygon[chosen + 1] * (s * (1 - v)) + polygon[chosen + 2] * (s * v);
}

}  // namespace radbake
