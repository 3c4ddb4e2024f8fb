/// A polygon as points see it: the form factor from a point.
#pragma once

#include <array>
#include <span>

#include "solver/scene/polygon.h"

namespace radbake {

/// Keeps what is the same from wherever a polygon is looked at. Of up to seven corners.
class SeenPolygon {
 public:
  explicit SeenPolygon(const Polygon& polygon);

  const Polygon& shape() const { return shape_; }

  /// Form factor from a differential area at `x` with unit normal `n` to the front of the polygon: the share
  /// of the cosine-weighted hemisphere that it covers, in [0, 1]. Lambert's formula (Photometria, 1760; Baum,
  /// Rushmeier, Winget 1989, eq. 6), the polygon clipped at the horizon:
  ///   F = 1/(2π) Σ_k Γ_k · n,  Γ_k = angle that edge k subtends, along the normal of its plane through x.
  /// `x` must not lie on an edge of the polygon (a limit exists from each side, not at the point).
  ///
  /// `tolerance`: where the polygon is so small for its distance, and in front of the horizon, that Gauss
  /// points on it err by less than this share on the average (by up to twenty times that where the horizon
  /// grazes it), they are taken, in a fraction of the time; 0: nowhere.
  double From(const Vec3& x, const Vec3& n, double tolerance = 0) const;

  /// The mean place of what is seen from there, weighted with cos·cos/r², by a few points: where a linear
  /// function over the polygon has the mean that is seen of it. The polygon's middle if none of it is seen.
  /// Three or four corners.
  Vec3 MiddleFrom(const Vec3& x, const Vec3& n) const;

  /// How much of the polygon is in front of the horizon of (x, n).
  enum class Part { kNothing, kSome, kAll };
  Part InFront(const Vec3& x, const Vec3& n) const;

 private:
  struct Point {
    Vec3 x;
    double area = 0;
  };
  std::span<const Point> points() const { return {points_.data(), count_}; }

  Polygon shape_;
  double offset_;  // of its plane
  Vec3 centre_;
  double radius2_ = 0;
  std::array<Point, 4> points_;  // of a rule of degree 2
  std::size_t count_ = 0;
};

/// SeenPolygon::From, for one look.
inline double PointToPolygon(const Vec3& x, const Vec3& n, const Polygon& polygon, double tolerance = 0) {
  return SeenPolygon(polygon).From(x, n, tolerance);
}

}  // namespace radbake
