/// Integrals over a polygon by a few points.
#pragma once

#include <array>
#include <span>

#include "solver/scene/polygon.h"

namespace radbake {

/// A place to be summed over, and its weight; the weights of a rule sum to 1.
struct QuadraturePoint {
  Vec3 x;
  double weight;
};

/// Gauss points inside a triangle or a convex quadrilateral (triangles: Strang and Fix 1973, Dunavant 1985;
/// quadrilaterals: Gauss-Legendre in their bilinear coordinates, weighted with the Jacobian).
class Quadrature {
 public:
  /// Exact for polynomials of `degree` 0 to 4 and, on triangles, no more: 1, 3 or 6 points, 1, 4 or 9 on
  /// quadrilaterals. Corners 3 or 4.
  Quadrature(const Polygon& polygon, int degree);

  std::span<const QuadraturePoint> points() const { return {points_.data(), count_}; }
  double area() const { return area_; }  ///< of the polygon

 private:
  void AddTriangle(const Polygon& triangle, double a, double weight);
  /// N × N points at these places of [0, 1] in each bilinear coordinate, with these shares of it.
  template <std::size_t N>
  void AddQuadrilateral(const Polygon& polygon, const std::array<double, N>& node,
                        const std::array<double, N>& share);

  static constexpr std::size_t kMost = 9;
  std::array<QuadraturePoint, kMost> points_;
  std::size_t count_ = 0;
  double area_ = 0;
};

}  // namespace radbake
