#include "solver/scene/polygon.h"

#include <algorithm>
#include <limits>

namespace radbake {

Polygon ClipToFront(const Polygon& polygon, const Plane& plane) {
  Polygon result;
  result.normal = polygon.normal;
  result.patch = polygon.patch;
  for (int k = 0; k < polygon.count; ++k) {
    const Vec3& a = polygon[k];
    const Vec3& b = polygon[(k + 1) % polygon.count];
    const double da = plane.Distance(a);
    const double db = plane.Distance(b);
    if (da > 0) {
      result[result.count++] = a;
    }
    if ((da > 0) != (db > 0)) {
      result[result.count++] = a + (b - a) * (da / (da - db));
    }
  }
  if (result.count < 3) {
    result.count = 0;
  }
  return result;
}

double Area(const Polygon& polygon) {
  Vec3 sum = Vec3::Zero();
  for (int k = 1; k + 1 < polygon.count; ++k) {
    sum += (polygon[k] - polygon[0]).cross(polygon[k + 1] - polygon[0]);
  }
  return 0.5 * sum.norm();
}

Vec3 NearestPoint(const Polygon& polygon, const Vec3& p) {
  const Vec3 projected = p - PlaneOf(polygon).Distance(p) * polygon.normal;
  Vec3 nearest = projected;
  double best = std::numeric_limits<double>::infinity();
  bool inside = true;
  for (int k = 0; k < polygon.count; ++k) {
    const Vec3& a = polygon[k];
    const Vec3 along = polygon[(k + 1) % polygon.count] - a;
    inside = inside && polygon.normal.cross(along).dot(projected - a) >= 0;
    const double length2 = along.squaredNorm();
    const double t = length2 > 0 ? std::clamp((projected - a).dot(along) / length2, 0.0, 1.0) : 0.0;
    const Vec3 candidate = a + t * along;
    const double distance = (candidate - projected).squaredNorm();
    if (distance < best) {
      best = distance;
      nearest = candidate;
    }
  }
  return inside ? projected : nearest;
}

}  // namespace radbake
