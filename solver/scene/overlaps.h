/// Surfaces that lie in one plane and over one another (what flickers in a viewer: z-fighting).
#pragma once

#include <span>
#include <vector>

#include "solver/scene/polygon.h"

namespace radbake {

/// Of several faces that look the same way from the same place, the brightest is the one that is there, and
/// the first of those that shine alike: it gives light and is lit, the others are under it. Else light would
/// count each; and a lamp in the plane of its ceiling is meant to be seen.
class Overlaps {
 public:
  /// Faces as polygons and what they emit, by index; those without corners lie over nothing. What is nearer
  /// to a plane than `tolerance` lies in it. n·log n steps for n faces, unless many cross one place.
  Overlaps(std::span<const Polygon> faces, std::span<const double> emission, double tolerance);

  bool empty() const { return covers_.empty(); }
  /// Does any face lie over a part of this one?
  bool AnyOver(Index face) const { return !(*this)[face].empty(); }
  /// The face that is there at the point `x` of this one: one that lies over it, or itself.
  Index At(Index face, const Vec3& x) const;

 private:
  struct Pair {
    Index under;
    Index over;
    bool operator==(const Pair&) const = default;
  };
  /// The pairs with this face below.
  std::span<const Pair> operator[](Index face) const;

  std::vector<Pair> covers_;   // by the face under, and what is there before what is not
  std::vector<Polygon> over_;  // by pair
};

}  // namespace radbake
