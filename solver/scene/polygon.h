/// A convex planar polygon on the stack: the shape of an element, and what is left of one after clipping.
#pragma once

#include <array>

#include "solver/scene/types.h"

namespace radbake {

/// Corners counter-clockwise seen from the side that `normal` (unit) points to. Seven is a quadrilateral
/// clipped by three planes, more than any step here needs.
struct Polygon {
  std::array<Vec3, 7> corner;
  int count = 0;
  Vec3 normal;
  Index patch = kNone;  ///< what it is a part of, if anything

  Vec3 Centroid() const {
    Vec3 sum = Vec3::Zero();
    for (int k = 0; k < count; ++k) {
      sum += corner[static_cast<std::size_t>(k)];
    }
    return sum / count;
  }
  const Vec3& operator[](int k) const { return corner[static_cast<std::size_t>(k)]; }
  Vec3& operator[](int k) { return corner[static_cast<std::size_t>(k)]; }
};

/// The oriented plane { x : normal·x = offset }; its front is where normal·x > offset.
struct Plane {
  Vec3 normal;
  double offset = 0;
  double Distance(const Vec3& x) const { return normal.dot(x) - offset; }
};

inline Plane PlaneOf(const Polygon& polygon) {
  return {polygon.normal, polygon.normal.dot(polygon[0])};
}

/// The part of `polygon` in front of `plane` (Sutherland and Hodgman 1974); count 0 if nothing is.
Polygon ClipToFront(const Polygon& polygon, const Plane& plane);

/// Area of a convex polygon.
double Area(const Polygon& polygon);

/// The point of a convex polygon that is nearest to `p`.
Vec3 NearestPoint(const Polygon& polygon, const Vec3& p);

}  // namespace radbake
