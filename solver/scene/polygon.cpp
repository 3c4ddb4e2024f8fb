#include "solver/scene/polygon.h"

namespace radbake {

Polygon ClipToFront(const Polygon& polygon, const Plane& plane) {
  Polygon result;
  result.normal = polygon.normal;
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

}  // namespace radbake
