/// The full matrix: Goral, Torrance, Greenberg, Battaile, Modeling the interaction of light between diffuse
/// surfaces (SIGGRAPH 1984): the reference that the other methods are measured against.
#pragma once

#include "solver/refine/oracle.h"

namespace radbake {

/// Keeps links between leaves alone, and divides everything else down to leaves of one size, of more than a
/// quarter of the given area and no more than it: in the end every two of them that face one another are
/// linked, and the rows of the operator are those of the matrix of Goral's equation 9,
///   B_i = E_i + ρ_i·Σ_j F_ij·B_j.
class MatrixOracle : public Oracle {
 public:
  /// `leaf_area` normalised.
  explicit MatrixOracle(double leaf_area) : leaf_area_(leaf_area) {}
  Decision Judge(const Hierarchy& hierarchy, const Link& link) const override;

 private:
  double leaf_area_;
};

}  // namespace radbake
