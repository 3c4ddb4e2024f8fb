/// The adaptive oracle: Hanrahan, Salzman, Aupperle (SIGGRAPH 1991), section 4: BF refinement by transported
/// energy.
#pragma once

#include "solver/hierarchy/light.h"
#include "solver/refine/oracle.h"

namespace radbake {

/// Keeps a link if the uncertain part of the power that it transports, B·A·F weighted with
/// - how much the form factor varies over the receiver, and how uncertain the visibility is, as far as the
/// receiver
///   passes it on (ρ): what the output shows is gathered anew at each vertex, with its own form factors and
///   rays;
/// - how much the radiosity varies over the shooter,
/// is below W_min. Divides the side that the larger part comes from, down to A_min.
class AdaptiveOracle : public Oracle {
 public:
  /// `a_min` normalised area; `w_min` normalised power. `light` must outlive the oracle and
  /// have been extended to all elements that links use when they are judged; younger elements are judged by
  /// their nearest older ancestor.
  AdaptiveOracle(const Light& light, double a_min, double w_min)
      : light_(light), a_min_(a_min), w_min_(w_min) {}
  Decision Judge(const Hierarchy& hierarchy, const Link& link) const override;

 private:
  struct Shot {
    double radiosity;  // luminous, as the receiver sees it
    double variation;
  };
  Shot ShotOf(const Hierarchy& hierarchy, const Link& link) const;

  const Light& light_;
  double a_min_;
  double w_min_;
};

}  // namespace radbake
