/// Unoccluded form factors: in closed form, or by a few points where those are as good.
#pragma once

#include "solver/scene/polygon.h"

namespace radbake {

/// Form factor from a differential area at `x` with unit normal `n` to the front of a convex polygon: the
/// share of the cosine-weighted hemisphere that it covers, in [0, 1]. Lambert's formula (Photometria, 1760;
/// Baum, Rushmeier, Winget 1989, eq. 6), the polygon clipped at the horizon:
///   F = 1/(2π) Σ_k Γ_k · n,  Γ_k = angle that edge k subtends, along the normal of its plane through x.
/// `x` must not lie on an edge of the polygon (a limit exists from each side, not at the point).
///
/// `tolerance`: where the polygon is so small for its distance, and in front of the horizon, that Gauss
/// points on it err by less than this share on the average (by up to twenty times that where the horizon
/// grazes it), they are taken, in a fraction of the time; 0: nowhere.
double PointToPolygon(const Vec3& x, const Vec3& n, const Polygon& polygon, double tolerance = 0);

/// A_i·F_ij = A_j·F_ji between the fronts of two convex polygons, each clipped at the other's plane, by
/// Stokes' theorem applied twice (Sparrow 1963; Cohen and Wallace 1993, section 4.3):
///   A_i·F_ij = 1/(2π) ∮_i ∮_j ln r dx_i·dx_j
/// The inner integral is closed; the outer one is Gauss-Legendre, graded geometrically towards where edges
/// touch. Relative error below 1e-7 for pairs up to some 100 sizes apart, touching ones included.
///
/// `tolerance`: as above, for Gauss points on both. Reciprocal to rounding either way.
double ExchangeArea(const Polygon& i, const Polygon& j, double tolerance = 0);

}  // namespace radbake
