/// How a solve went: one record an iteration, and where the light ended.
#pragma once

#include <cstddef>
#include <cstdint>

#include "solver/scene/types.h"

namespace radbake {

/// One refinement pass and the sweeps that followed it.
struct Iteration {
  std::size_t pass = 0;
  std::size_t sweeps = 0;  ///< operator applications of this pass
  double residual = 0;     ///< after them: RMS by area of (πL_e + ρ·K·B − B) / mean B around, worst channel
  std::size_t elements = 0;
  std::size_t links = 0;
  std::size_t factors = 0;  ///< form factors computed so far
  std::uint64_t rays = 0;   ///< cast so far
  double seconds = 0;       ///< since the solve began
};

/// Bytes of memory that a solve holds at its last iteration.
struct SolveBytes {
  std::size_t elements = 0;  ///< all that grows with them: themselves, their light, the iteration's vectors
  std::size_t links = 0;     ///< the same of links: their sources, the rows and couplings made of them
};

/// Luminous power in lm, by channel. `escaped`, `absorbed_by_backs` and what lights without area and the sky
/// emit are counted by rays that know nothing of links, so the imbalance measures the links' form factors and
/// visibility, not only the convergence.
struct EnergyBalance {
  Rgb emitted = Rgb::Zero();            ///< Σ A·π·L_e
  Rgb absorbed = Rgb::Zero();           ///< Σ A·(1 − ρ)·E
  Rgb absorbed_by_backs = Rgb::Zero();  ///< on back sides and blockers
  Rgb escaped = Rgb::Zero();            ///< out of the scene
  double imbalance = 0;                 ///< |emitted − absorbed − absorbed_by_backs − escaped| / emitted
};

}  // namespace radbake
