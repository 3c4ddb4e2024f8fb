#include "solver/transport/form_factor.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>
#include <tuple>
#include <utility>

#include "solver/scene/quadrature.h"
#include "solver/transport/seen_polygon.h"

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

/// The share by which a contour integral may be off.
struct ContourError {
  double share;
  double digits = -std::log(share);
};

/// ∫ over `outer` of LogIntegral(·, inner). The integrand is analytic but where `outer` comes close to the
/// ends of `inner`, or to the line through it if they are not parallel: halved until the distance is as large
/// as the piece, the rule converges geometrically. Pieces below `shortest` all lie at one point, and matter
/// to nothing.
double EdgePairIntegral(const Edge& outer, const Edge& inner, bool parallel, const ContourError& error,
                        double shortest) {
  double distance = std::min(PointSegmentDistance(inner.start, outer),
                             PointSegmentDistance(inner.start + inner.length * inner.direction, outer));
  if (!parallel) {
    distance = std::min(distance, LineRootDistance(outer, inner));
  }
  if (distance < outer.length && outer.length > shortest) {
    const double half = 0.5 * outer.length;
    return EdgePairIntegral({outer.start, outer.direction, half}, inner, parallel, error, shortest) +
           EdgePairIntegral({outer.start + half * outer.direction, outer.direction, half}, inner, parallel,
                            error, shortest);
  }
  // An n-point rule errs by ρ^(−2n), ρ the sum of the semi-axes of the largest ellipse of analyticity; the
  // terms of the contour cancel down to about (length/distance)² of their size.
  const double ratio = std::max(1.0, 2 * distance / outer.length);
  const double rho = ratio + std::sqrt(1 + ratio * ratio);
  constexpr int kFewest = 3;
  const int n =
      std::clamp(static_cast<int>(std::ceil((0.5 * error.digits + std::log(ratio)) / std::log(rho))), kFewest,
                 GaussRules::kMaxOrder);
  double sum = 0;
  for (const GaussPoint& point : kGauss[n]) {
    sum += point.weight * LogIntegral(outer.start + point.node * outer.length * outer.direction, inner);
  }
  return sum * outer.length;
}

double EdgePairIntegral(const Edge& a, const Edge& b, bool parallel, const ContourError& error) {
  // The shorter edge outside: fewer points, and the closed form takes the long way. What it exchanges is
  // about its own square, of which a piece gives up to its length times that of the other.
  const Edge& outer = a.length < b.length ? a : b;
  const Edge& inner = a.length < b.length ? b : a;
  constexpr double kRounding = 1e-14;
  return EdgePairIntegral(outer, inner, parallel, error,
                          std::max(kRounding, error.share * outer.length * outer.length / inner.length));
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

/// Clips to the front of the plane where there is something to clip, which `clipped` is told. False if
/// nothing is in front.
bool KeepFront(Polygon& polygon, const Plane& plane, bool& clipped) {
  const Extent extent = ExtentOver(polygon, plane);
  if (extent.front <= kOnPlane) {
    return false;
  }
  if (extent.behind > kOnPlane) {
    polygon = ClipToFront(polygon, plane);
    clipped = true;
  }
  return polygon.count >= 3;
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

/// The same by the points of one, in closed form over the other.
double FromPoints(const Polygon& from, const Polygon& to) {
  const Quadrature on_from(from, 4);
  const SeenPolygon seen(to);
  double sum = 0;
  for (const QuadraturePoint& point : on_from.points()) {
    sum += point.weight * seen.From(point.x, from.normal);
  }
  return on_from.area() * sum;
}

/// Do the points of one, of this squared radius, err by less than `tolerance` beside the other? Measured as
/// DegreeFor; `grazing`: of polygons that were clipped.
bool MayTakePointsOf(const Vec3& centre, double radius2, const Polygon& other, bool grazing,
                     double tolerance) {
  const double q2 = radius2 / (NearestPoint(other, centre) - centre).squaredNorm();
  return (grazing ? 5e-3 : 1e-3) * q2 * q2 <= tolerance;
}

/// Which of two is taken apart, so that it does not matter which one is asked from.
bool IsBefore(double radius2_i, const Vec3& centre_i, double radius2_j, const Vec3& centre_j) {
  return std::tie(radius2_i, centre_i[0], centre_i[1], centre_i[2]) <
         std::tie(radius2_j, centre_j[0], centre_j[1], centre_j[2]);
}

/// A_i·F_ij by the contours of both.
double BetweenContours(const Polygon& i, const Polygon& j, const ContourError& error) {
  std::array<Edge, 7> edges_i;
  std::array<Edge, 7> edges_j;
  const int count_i = MakeEdges(i, edges_i);
  const int count_j = MakeEdges(j, edges_j);
  double sum = 0;
  for (const Edge& a : std::span(edges_i.data(), static_cast<std::size_t>(count_i))) {
    for (const Edge& b : std::span(edges_j.data(), static_cast<std::size_t>(count_j))) {
      const double cosine = a.direction.dot(b.direction);
      if (std::abs(cosine) > 1e-15) {
        const bool parallel = std::abs(cosine) > 1 - 1e-12;
        sum += cosine * EdgePairIntegral(a, b, parallel, error);
      }
    }
  }
  return std::max(0.0, sum / kTwoPi);
}

}  // namespace

double ExchangeArea(const Polygon& i, const Polygon& j, double tolerance) {
  Polygon front_i = i;
  Polygon front_j = j;
  bool clipped = false;
  if (!KeepFront(front_i, PlaneOf(j), clipped) || !KeepFront(front_j, PlaneOf(i), clipped)) {
    return 0;
  }
  if (tolerance > 0 && front_i.count <= 4 && front_j.count <= 4) {
    const Vec3 centre_i = front_i.Centroid();
    const Vec3 centre_j = front_j.Centroid();
    const double radius2_i = SquaredRadius(front_i, centre_i);
    const double radius2_j = SquaredRadius(front_j, centre_j);
    const double radius = std::sqrt(radius2_i) + std::sqrt(radius2_j);
    if (const int degree = DegreeFor(radius * radius, (centre_i - centre_j).squaredNorm(), tolerance)) {
      return BetweenPoints(front_i, front_j, degree);
    }
    if (IsBefore(radius2_i, centre_i, radius2_j, centre_j)) {
      if (MayTakePointsOf(centre_i, radius2_i, front_j, clipped, tolerance)) {
        return FromPoints(front_i, front_j);
      }
    } else if (MayTakePointsOf(centre_j, radius2_j, front_i, clipped, tolerance)) {
      return FromPoints(front_j, front_i);
    }
  }
  // Grazing ones cancel further.
  constexpr double kExact = 1e-9;
  constexpr double kOfTolerance = 0.1;
  return BetweenContours(front_i, front_j, {std::max(kExact, kOfTolerance * tolerance)});
}

}  // namespace radbake
