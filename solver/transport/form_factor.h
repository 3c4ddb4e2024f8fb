/// Unoccluded form factors between polygons: in closed form, or by points where those are as good.
#pragma once

#include "solver/scene/polygon.h"

namespace radbake {

/// A_i·F_ij = A_j·F_ji between the fronts of two convex polygons, each clipped at the other's plane, by
/// Stokes' theorem applied twice (Sparrow 1963; Cohen and Wallace 1993, section 4.3):
///   A_i·F_ij = 1/(2π) ∮_i ∮_j ln r dx_i·dx_j
/// The inner integral is closed; the outer one is Gauss-Legendre, graded geometrically towards where edges
/// touch. Relative error below 1e-7 for pairs up to some 100 sizes apart, touching ones included.
///
/// `tolerance`: where Gauss points on both, or on one with the closed form over the other (SeenPolygon), err
/// by less than this share on the average, they are taken; else the contours are integrated no better than
/// that. 0: contours everywhere. Reciprocal to rounding either way.
double ExchangeArea(const Polygon& i, const Polygon& j, double tolerance = 0);

}  // namespace radbake
