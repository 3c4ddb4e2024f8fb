/// The static oracle: Hanrahan, Salzman, Aupperle, A rapid hierarchical radiosity algorithm (SIGGRAPH 1991),
/// section 3: F refinement.
#pragma once

#include "solver/refine/oracle.h"

namespace radbake {

/// Before any radiosity is known: two nodes may be linked if the estimated form factor is below F_max each
/// way (a quarter of it where something hides a part of one from the other), or if both areas are below
/// A_min; else the larger one is divided. What lights without an area of its own has no such form factors:
/// receivers are divided down to A_min for lights that are points, and for the sky where they see it in part.
class HierarchicalOracle : public Oracle {
 public:
  /// `a_min` normalised area, `f_max` in (0, 1).
  HierarchicalOracle(double a_min, double f_max) : a_min_(a_min), f_max_(f_max) {}
  Decision Judge(const Hierarchy& hierarchy, const Link& link) const override;

 private:
  double a_min_;
  double f_max_;
};

/// The oracle's cheap estimate of the form factor from a point of `from` to `to`, full visibility assumed:
/// the disc of `to`'s area at the distance of the centres (of the nearest point, if `to` is long), cosines
/// taken at the better end of each element's extent, so that it bounds the form factor of the pair from above
/// but for a small factor (section 3.2; Wallace 1989, eq. 5):
///   F ≈ cos θ · A / (π·d² + A)
double EstimateFormFactor(const Polygon& from, const Polygon& to, double to_area);

}  // namespace radbake
