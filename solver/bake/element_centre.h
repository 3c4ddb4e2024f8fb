/// The middle of an element, where irradiance is gathered beside its vertices.
#pragma once

#include <array>

#include "solver/hierarchy/hierarchy.h"

namespace radbake {

/// Weights of an element's three or four corners at its centre: dyadic, so that they sum to exactly 1 in
/// float too.
inline std::array<float, 4> CentreWeights(int corners) {
  constexpr float kUnit = 1.0F / 1024;
  return corners == 4 ? std::array{0.25F, 0.25F, 0.25F, 0.25F}
                      : std::array{341 * kUnit, 341 * kUnit, 342 * kUnit, 0.0F};
}

/// The place that they give, of an element of this shape.
Vec3 ElementCentre(const Polygon& shape);

/// A hair from a point of an element, towards its inside. At an outline form factors have a limit from each
/// side, and within rounding of one, rays miss the surface beyond it; and an element's centre may lie on an
/// outline of a younger element of the solver's.
Vec3 InsideNear(const Hierarchy& hierarchy, Index element, const Vec3& x);

}  // namespace radbake
