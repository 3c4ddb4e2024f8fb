#include "solver/refine/matrix.h"

namespace radbake {

Decision MatrixOracle::Judge(const Hierarchy& hierarchy, const Link& link) const {
  if (IsDivisible(hierarchy, link.receiver, leaf_area_)) {
    return Decision::kDivideReceiver;
  }
  return IsDivisible(hierarchy, link.shooter, leaf_area_) ? Decision::kDivideShooter : Decision::kKeep;
}

}  // namespace radbake
