/// How a polynomial over one element lights another (Zatz, Galerkin radiosity, SIGGRAPH 1993; Gortler et al.
/// 1993): the kernel's moments.
#pragma once

#include <span>

#include "solver/hierarchy/basis.h"
#include "solver/transport/seen_polygon.h"
#include "solver/transport/visibility.h"

namespace radbake {

/// An element as an end of a link: its points, and the basis there.
struct BasisEnd {
  BasisEnd(const Hierarchy& hierarchy, const Basis& basis, Index element);

  SeenPolygon seen;
  double area = 0;
  Quadrature rule;
  std::array<BasisValues, 9> values;  ///< by point of the rule
};

/// The means of φ_0 … over the shooter as it is seen from `x` with unit normal `n`, by the rule's points:
/// weighted with the kernel cos·cos/r², so where the polynomial is positive, what is seen of it is. Those of
/// an even shooter if none of it is seen.
BasisValues SeenFrom(const Vec3& x, const Vec3& n, const BasisEnd& shooter);

/// The moments of `f(x)` over an element: the means of φ_i·f, by the rule's points.
template <typename Function>
BasisValues MomentsOver(const BasisEnd& element, const Function& f) {
  BasisValues moments{};
  for (std::size_t q = 0; q < element.rule.points().size(); ++q) {
    const QuadraturePoint& point = element.rule.points()[q];
    const double value = point.weight * f(point.x);
    for (std::size_t k = 0; k < moments.size(); ++k) {
      moments[k] += value * element.values[q][k];
    }
  }
  return moments;
}

/// T_ij = 1/A_i ∫∫ φ_i(x)·φ_j(y)·cos·cos/(π·r²) dy dx, unoccluded, for φ_j of the shooter from φ_1 on, row by
/// row: K rows of K − 1. Where φ_i = 1, it is the moment of the form factor from the shooter to the receiver,
/// in closed form, so that what one receiver gains of an uneven shooter another loses. Elsewhere the closed
/// form over the shooter from each point of the receiver, times SeenFrom: exact where the kernel is smooth,
/// bounded where the two touch.
void CoupleShaped(const BasisEnd& receiver, const BasisEnd& shooter, std::size_t count,
                  std::span<float> couplings);

/// What visibility adds to T_0j beside its mean, as a share of the form factor: Cov(V, φ_j) over the pair by
/// its kernel, by `rays` rays that `key` seeds. Of an uneven shooter that is hidden in part it makes a
/// difference whether its bright or its dark part is. 0 for φ_0, and where all rays are blocked or none.
BasisValues HiddenMoments(const Visibility& visibility, const BasisEnd& receiver, const BasisEnd& shooter,
                          const ElementBasis& basis, std::uint64_t key, int rays);

}  // namespace radbake
