/// Two levels, patches and elements: Cohen, Greenberg, Immel, Brock, An efficient radiosity approach for
/// realistic image synthesis (IEEE Computer Graphics and Applications 6(3), 1986).
///
/// Patches shoot and elements receive: of M patches with N elements, M × N form factors F_qj from element q
/// to patch j. What patches exchange is their elements' mean, F_ij = Σ_q∈i F_qj·A_q/A_i, so M equations give
/// the patches' radiosities, and these the elements',
///   B_q = E_q + ρ_q·Σ_j F_qj·B_j.
/// Where neighbouring elements differ much, they are divided, and only their rows of F_qj are replaced.
#pragma once

#include <vector>

#include "solver/hierarchy/light.h"
#include "solver/refine/oracle.h"

namespace radbake {

/// A patch of the paper is any node of at most `patch`, its parent being larger: input patches are divided
/// that far first. Normalised areas, `element` < `patch`.
struct TwoLevelAreas {
  double patch = 0;
  double element = 0;  ///< the largest area of an element before any is divided for its gradient
};

/// Keeps links from patches to elements alone.
class TwoLevelOracle : public Oracle {
 public:
  /// `steep`: elements to divide once more, in ascending order.
  TwoLevelOracle(const TwoLevelAreas& areas, std::vector<Index> steep)
      : areas_(areas), steep_(std::move(steep)) {}
  Decision Judge(const Hierarchy& hierarchy, const Link& link) const override;

 private:
  TwoLevelAreas areas_;
  std::vector<Index> steep_;
};

/// The patches: nodes that together cover all surfaces once, in ascending order.
std::vector<Index> PatchLevel(const Hierarchy& hierarchy, double patch_area);

/// The leaves of more than `smallest` (normalised area) whose luminous irradiance differs from that of a
/// neighbour, a leaf that meets it in a vertex of the same surface, by more than `gradient` times its RMS
/// over all surfaces. In ascending order.
std::vector<Index> SteepElements(const Hierarchy& hierarchy, const Light& light, double gradient,
                                 double smallest);

}  // namespace radbake
