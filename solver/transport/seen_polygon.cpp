#include "solver/transport/seen_polygon.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "solver/scene/quadrature.h"

namespace radbake {
namespace {

// Distances to the horizon below this are rounding of unit-sized coordinates.
constexpr double kOnHorizon = 1e-12;

/// θ / sin θ · 1/|u|·|v|, for sine2 = (|u|·|v|·sin θ)² and cosine = |u|·|v|·cos θ; 0 where sin θ is. By the
/// power series of the arc tangent where tan² of the angle, halved often enough, is small: to the last
/// digits, and in a third of the time of atan2().
double AngleOverSine(double sine2, double cosine) {
  if (!(cosine > 0)) {
    const double sine = std::sqrt(sine2);
    return sine > 0 ? std::atan2(sine, cosine) / sine : 0;
  }
  constexpr double kSmall = 0.05;
  double rest = cosine;  // tan of the part of the angle = sine / rest
  double parts = 1;
  while (sine2 > kSmall * rest * rest) {
    rest += std::sqrt(rest * rest + sine2);
    parts *= 2;
  }
  const double t = -sine2 / (rest * rest);
  double series = 1.0 / 21;
  for (int odd = 19; odd > 0; odd -= 2) {
    series = series * t + 1.0 / odd;
  }
  return parts * series / rest;
}

/// Σ θ_k·n·(v_k × u_k)/|v_k × u_k| / 2π over the edges of what is in front of the horizon (Lambert 1760).
double Lambert(const Vec3& x, const Vec3& n, const Polygon& visible) {
  double sum = 0;
  Vec3 u = visible[std::max(visible.count, 1) - 1] - x;
  for (int k = 0; k < visible.count; ++k) {
    const Vec3 v = visible[k] - x;
    const Vec3 normal = v.cross(u);
    sum += AngleOverSine(normal.squaredNorm(), u.dot(v)) * normal.dot(n);
    u = v;
  }
  return std::clamp(sum / (2 * std::numbers::pi), 0.0, 1.0);
}

}  // namespace

SeenPolygon::SeenPolygon(const Polygon& polygon)
    : shape_(polygon), offset_(PlaneOf(polygon).offset), centre_(polygon.Centroid()) {
  for (int k = 0; k < polygon.count; ++k) {
    radius2_ = std::max(radius2_, (polygon[k] - centre_).squaredNorm());
  }
  if (polygon.count == 3 || polygon.count == 4) {
    const Quadrature rule(polygon, 2);
    for (const QuadraturePoint& point : rule.points()) {
      points_[count_++] = {point.x, rule.area() * point.weight};
    }
  }
}

SeenPolygon::Part SeenPolygon::InFront(const Vec3& x, const Vec3& n) const {
  const double middle = n.dot(centre_ - x);
  if (middle * middle > radius2_) {
    return middle > 0 ? Part::kAll : Part::kNothing;
  }
  double lowest = 0;
  double highest = 0;
  for (int k = 0; k < shape_.count; ++k) {
    const double height = n.dot(shape_[k] - x);
    lowest = std::min(lowest, height);
    highest = std::max(highest, height);
  }
  return highest <= kOnHorizon ? Part::kNothing : lowest < -kOnHorizon ? Part::kSome : Part::kAll;
}

double SeenPolygon::From(const Vec3& x, const Vec3& n, double tolerance) const {
  const double height = shape_.normal.dot(x) - offset_;
  if (height <= 0) {
    return 0;
  }
  const Part part = InFront(x, n);
  if (part == Part::kNothing) {
    return 0;
  }
  if (part == Part::kSome) {
    return Lambert(x, n, ClipToFront(shape_, {n, n.dot(x)}));
  }
  // Measured over random triangles and quadrilaterals of aspects up to 10.
  const double distance2 = (centre_ - x).squaredNorm();
  if (count_ > 0 && 0.5 * radius2_ * radius2_ <= tolerance * distance2 * distance2) {
    double sum = 0;
    for (const Point& point : points()) {
      const Vec3 along = point.x - x;
      const double r2 = along.squaredNorm();
      sum += point.area * along.dot(n) / (r2 * r2);
    }
    return std::numbers::inv_pi * height * sum;
  }
  return Lambert(x, n, shape_);
}

Vec3 SeenPolygon::MiddleFrom(const Vec3& x, const Vec3& n) const {
  Vec3 sum = Vec3::Zero();
  double all = 0;
  for (const Point& point : points()) {
    const Vec3 along = point.x - x;
    const double out = along.dot(n);
    if (out > 0) {
      const double r2 = along.squaredNorm();
      const double kernel = point.area * out / (r2 * r2);
      sum += kernel * point.x;
      all += kernel;
    }
  }
  return all > 0 ? Vec3(sum / all) : centre_;
}

}  // namespace radbake
