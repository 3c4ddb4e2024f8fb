#include "solver/transport/form_factor.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>
#include <utility>

#include "solver/scene/quadrature.h"

namespace radbake {
namespace {

constexpr double kTwoPi = 2 * std::numbers::pi;

struct GaussPoint {
  double node;  // in [0, 1]
  double weight;
};

/// Gauss-Legendre rules of 1 to kMaxOrder points on [0, 1], from Newton's method on the Legendre polynomials.
class GaussRules {
 public:
  static constexpr int kMaxOrder = 16;

  GaussRules() {
    for (int n = 1; n <= kMaxOrder; ++n) {
      for (int k = 0; k < n; ++k) {
        double x = std::cos(std::numbers::pi * (k + 0.75) / (n + 0.5));
        double slope = 0;
        for (int step = 0; step < 100; ++step) {
          double p0 = 1;
          double p1 = x;
          for (int m = 2; m <= n; ++m) {
            p0 = std::exchange(p1, ((2 * m - 1) * x * p1 - (m - 1) * p0) / m);
          }
          slope = n * (x * p1 - p0) / (x * x - 1);
          const double move = p1 / slope;
          x -= move;
          if (std::abs(move) < 1e-16) {
            break;
          }
        }
        At(n)[static_cast<std::size_t>(k)] = {0.5 * (1 - x), 1 / ((1 - x * x) * slope * slope)};
      }
    }
  }

  std::span<const GaussPoint> operator[](int n) const {
    return {rules_[static_cast<std::size_t>(n)].data(), static_cast<std::size_t>(n)};
  }

 private:
  std::array<GaussPoint, kMaxOrder>& At(int n) { return rules_[static_cast<std::size_t>(n)]; }
  std::array<std::array<GaussPoint, kMaxOrder>, kMaxOrder + 1> rules_{};
};

const GaussRules kGauss;

struct Edge {
  Vec3 start;
  Vec3 direction;  // unit
  double length;
};

/// ∫_0^L ln|p − (start + t·direction)| dt.
double LogIntegral(const Vec3& p, const Edge& edge) {
  const Vec3 from = edge.start - p;
  const double u0 = from.dot(edge.direction);
  const double u1 = u0 + edge.length;
  const double h2 = std::max(0.0, from.squaredNorm() - u0 * u0);
  const double h = std::sqrt(h2);
  const double r0 = h2 + u0 * u0;
  const double r1 = h2 + u1 * u1;
  const double log_part = (r1 > 0 ? u1 * std::log(r1) : 0) - (r0 > 0 ? u0 * std::log(r0) : 0);
  return 0.5 * log_part - edge.length + h * std::atan2(h * edge.length, h2 + u0 * u1);
}

double PointSegmentDistance(const Vec3& p, const Edge& edge) {
  const double t = std::clamp((p - edge.start).dot(edge.direction), 0.0, edge.length);
  return (edge.start + t * edge.direction - p).norm();
}

/// How far off `outer`, in its complexified parameter, the root of the distance to the line through `inner`
/// lies: at t0 ± i·d/sin θ, t0 the point of `outer` next to that line, d the distance of both lines, θ their
/// angle. It counts only beside `inner` itself. Edges that are all but one line, as rounding makes them, have
/// it far away though they are close.
double LineRootDistance(const Edge& outer, const Edge& inner) {
  const Vec3 r = outer.start - inner.start;
  const Vec3 across = outer.direction.cross(inner.direction);
  const double sine2 = across.squaredNorm();
  const double t0 = inner.direction.cross(r).dot(across) / sine2;
  const double beside = (r + t0 * outer.direction).dot(inner.direction);
  if (beside < 0 || beside > inner.length) {
    return std::numeric_limits<double>::infinity();
  }
  return std::hypot(t0 - std::clamp(t0, 0.0, outer.length), r.dot(across) / sine2);
}

/// ∫ over `outer` of LogIntegral(·, inner). The integrand is analytic but where `outer` comes close to the
/// ends of `inner`, or to the line through it if they are not parallel: halved until the distance is as large
/// as the piece, the rule converges geometrically.
double EdgePairIntegral(const Edge& outer, const Edge& inner, bool parallel) {
  double distance = std::min(PointSegmentDistance(inner.start, outer),
                             PointSegmentDistance(inner.start + inner.length * inner.direction, outer));
  if (!parallel) {
    distance = std::min(distance, LineRootDistance(outer, inner));
  }
  // Pieces of rounding's size all lie at one point, and matter to nothing.
  constexpr double kShortest = 1e-14;
  if (distance < outer.length && outer.length > kShortest) {
    const double half = 0.5 * outer.length;
    return EdgePairIntegral({outer.start, outer.direction, half}, inner, parallel) +
           EdgePairIntegral({outer.start + half * outer.direction, outer.direction, half}, inner, parallel);
  }
  // An n-point rule errs by ρ^(−2n), ρ the sum of the semi-axes of the largest ellipse of analyticity; the
  // terms of the contour cancel down to about (length/distance)² of their size.
  const double ratio = std::max(1.0, 2 * distance / outer.length);
  const double rho = ratio + std::sqrt(1 + ratio * ratio);
  const int n =
      std::clamp(static_cast<int>(std::ceil((0.5 * std::log(1e9) + std::log(ratio)) / std::log(rho))), 3,
                 GaussRules::kMaxOrder);
  double sum = 0;
  for (const GaussPoint& point : kGauss[n]) {
    sum += point.weight * LogIntegral(outer.start + point.node * outer.length * outer.direction, inner);
  }
  return sum * outer.length;
}

int MakeEdges(const Polygon& polygon, std::array<Edge, 7>& edges) {
  int count = 0;
  for (int k = 0; k < polygon.count; ++k) {
    const Vec3 along = polygon[(k + 1) % polygon.count] - polygon[k];
    const double length = along.norm();
    if (length > 0) {
      edges[static_cast<std::size_t>(count++)] = {polygon[k], along / length, length};
    }
  }
  return count;
}

/// How far the polygon reaches in front of the plane, and behind it.
struct Extent {
  double front = 0;
  double behind = 0;
};

Extent ExtentOver(const Polygon& polygon, const Plane& plane) {
  Extent extent;
  for (int k = 0; k < polygon.count; ++k) {
    const double d = plane.Distance(polygon[k]);
    extent.front = std::max(extent.front, d);
    extent.behind = std::max(extent.behind, -d);
  }
  return extent;
}

// Distances to a plane below this are rounding of unit-sized coordinates: the polygons touch or are coplanar.
constexpr double kOnPlane = 1e-12;

/// Clips to the front of the plane where there is something to clip. False if nothing is in front.
bool KeepFront(Polygon& polygon, const Plane& plane) {
  const Extent extent = ExtentOver(polygon, plane);
  if (extent.front <= kOnPlane) {
    return false;
  }
  if (extent.behind > kOnPlane) {
    polygon = ClipToFront(polygon, plane);
  }
  return polygon.count >= 3;
}

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
  return std::clamp(sum / kTwoPi, 0.0, 1.0);
}

/// The degree of the points that err by less than `tolerance`, for ends of this radius squared, altogether,
/// at this distance squared; 0: none do. Measured over random triangles and quadrilaterals of aspects up
/// to 10.
int DegreeFor(double radius2, double distance2, double tolerance) {
  if (!(radius2 < distance2)) {
    return 0;
  }
  const double q2 = radius2 / distance2;
  if (0.4 * q2 * q2 <= tolerance) {
    return 2;
  }
  return 0.1 * q2 * q2 * q2 <= tolerance ? 4 : 0;
}

double SquaredRadius(const Polygon& polygon, const Vec3& centre) {
  double radius2 = 0;
  for (int k = 0; k < polygon.count; ++k) {
    radius2 = std::max(radius2, (polygon[k] - centre).squaredNorm());
  }
  return radius2;
}

/// ∫ cos θ_x·cos θ_y / r² over the points' polygon, without its area and the height of x over it.
double SumOver(const Quadrature& rule, const Vec3& x, const Vec3& n) {
  double sum = 0;
  for (const QuadraturePoint& point : rule.points()) {
    const Vec3 along = point.x - x;
    const double r2 = along.squaredNorm();
    sum += point.weight * along.dot(n) / (r2 * r2);
  }
  return sum;
}

/// A_i·F_ij by the points of both.
double BetweenPoints(const Polygon& i, const Polygon& j, int degree) {
  const Quadrature on_i(i, degree);
  const Quadrature on_j(j, degree);
  const Plane plane_j = PlaneOf(j);
  double sum = 0;
  for (const QuadraturePoint& point : on_i.points()) {
    sum += point.weight * plane_j.Distance(point.x) * SumOver(on_j, point.x, i.normal);
  }
  return std::max(0.0, std::numbers::inv_pi * on_i.area() * on_j.area() * sum);
}

}  // namespace

double PointToPolygon(const Vec3& x, const Vec3& n, const Polygon& polygon, double tolerance) {
  const double height = PlaneOf(polygon).Distance(x);
  if (height <= 0) {
    return 0;
  }
  const Plane horizon{n, n.dot(x)};
  const Extent extent = ExtentOver(polygon, horizon);
  if (extent.front <= kOnPlane) {
    return 0;
  }
  if (extent.behind > kOnPlane) {
    return Lambert(x, n, ClipToFront(polygon, horizon));
  }
  if (tolerance > 0 && polygon.count <= 4) {
    const Vec3 centre = polygon.Centroid();
    if (const int degree = DegreeFor(SquaredRadius(polygon, centre), (centre - x).squaredNorm(), tolerance)) {
      const Quadrature rule(polygon, degree);
      return std::numbers::inv_pi * height * rule.area() * SumOver(rule, x, n);
    }
  }
  return Lambert(x, n, polygon);
}

double ExchangeArea(const Polygon& i, const Polygon& j, double tolerance) {
  Polygon front_i = i;
  Polygon front_j = j;
  if (!KeepFront(front_i, PlaneOf(j)) || !KeepFront(front_j, PlaneOf(i))) {
    return 0;
  }
  if (tolerance > 0 && front_i.count <= 4 && front_j.count <= 4) {
    const Vec3 centre_i = front_i.Centroid();
    const Vec3 centre_j = front_j.Centroid();
    const double radius =
        std::sqrt(SquaredRadius(front_i, centre_i)) + std::sqrt(SquaredRadius(front_j, centre_j));
    if (const int degree = DegreeFor(radius * radius, (centre_i - centre_j).squaredNorm(), tolerance)) {
      return BetweenPoints(front_i, front_j, degree);
    }
  }
  std::array<Edge, 7> edges_i;
  std::array<Edge, 7> edges_j;
  const int count_i = MakeEdges(front_i, edges_i);
  const int count_j = MakeEdges(front_j, edges_j);
  double sum = 0;
  for (const Edge& a : std::span(edges_i.data(), static_cast<std::size_t>(count_i))) {
    for (const Edge& b : std::span(edges_j.data(), static_cast<std::size_t>(count_j))) {
      const double cosine = a.direction.dot(b.direction);
      if (std::abs(cosine) > 1e-15) {
        const bool parallel = std::abs(cosine) > 1 - 1e-12;
        // The shorter edge outside: fewer points, and the closed form takes the long way.
        sum += cosine *
               (a.length < b.length ? EdgePairIntegral(a, b, parallel) : EdgePairIntegral(b, a, parallel));
      }
    }
  }
  return std::max(0.0, sum / kTwoPi);
}

}  // namespace radbake
