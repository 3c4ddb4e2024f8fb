/// Statistics of a bake against noisy references.
#pragma once

#include <span>

#include "solver/check/check.h"

namespace radbake {

/// One probe: what the bake says, what the path tracer says, and the estimated variance of the latter, summed
/// over the channels; any one unit.
struct Comparison {
  Rgb baked;
  Rgb reference;
  double variance;
};

/// Fills in the error, the bias, their intervals and the noise. `comparisons` in the order of DrawProbes().
///
///   error² = Σ(|E_bake − E|² − v) / Σ(|E|² − v),  bias = Σ(E_bake − E) / ΣE
///
/// with v the variance of E: a noisy reference makes neither larger. Both are ratios of means, so their
/// standard errors come from the residuals z = x − ratio·y (the delta method). There is one probe a strip of
/// the surface, so what the strips have in common is no source of error, and the variance of z is ½·mean (z_i
/// − z_i+1)².
void Compare(std::span<const Comparison> comparisons, CheckSummary& summary);

}  // namespace radbake
