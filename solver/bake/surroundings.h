/// The light at a point that surfaces around it reflect, by rays over the hemisphere.
#pragma once

#include <functional>

#include "solver/bake/estimate.h"
#include "solver/hierarchy/light.h"
#include "solver/transport/visibility.h"

namespace radbake {

/// What a ray met.
struct Met {
  Vec3 y = Vec3::Zero();
  Index patch = kNone;  ///< kNone: a side that gives no light
};
using ReflectedThere = std::function<Rgb(const Met&)>;

/// The irradiance at `x` with unit normal `n` from what surfaces reflect, as radiosity, where rays with
/// cosine-weighted directions meet them, and from the sky where they meet nothing. Costs the same however
/// many patches are around. `rays`: about so many, in strata of the hemisphere; the variance is from
/// what each stratum differs by from its neighbours on both sides.
Estimate FromSurroundings(const Hierarchy& hierarchy, const Visibility& visibility, const Vec3& x,
                          const Vec3& n, double rays, std::uint64_t key, const ReflectedThere& reflected);

/// Signed distance from `x` to the nearest edge line of a convex polygon; positive inside.
double DepthInside(const Polygon& polygon, const Vec3& x);

/// The youngest descendant of `element` (or itself) that `light` knows, at `x`.
Index SolverLeafAt(const Hierarchy& hierarchy, const Light& light, Index element, const Vec3& x);

}  // namespace radbake
