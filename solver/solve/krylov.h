/// How the linear system (I − ρK)·B = π·L_e + ρ·E_distant is solved: by a Krylov method, or by plain sweeps.
#pragma once

#include <functional>

#include "solver/solve/radiosity_operator.h"

namespace radbake {

struct Convergence {
  std::size_t applications = 0;  ///< of the operator
  double residual = 0;           ///< of the B that was last applied: see Iteration
};

struct IterationOptions {
  double tolerance = 1e-4;  ///< largest relative error of the radiosity that may be left, by area
  /// Asked now and then with how far it is; true ends the iteration with what it has.
  std::function<bool(const Convergence&)> stop;
};

/// Begins with the radiosity that `light` holds, and leaves the solution in it. Restarted GMRES (Saad and
/// Schultz 1986) for the correction of B, in the norm by area with each patch's channels scaled to 1, all
/// three as one system. Since ‖K‖ ≤ 1, a residual below (1 − ρ_max)·tolerance ends it; where that is only an
/// estimate, it is the true residual that is compared, from one application more than the method itself
/// needs.
Convergence IterateByKrylov(const RadiosityOperator& radiosity_operator, const IterationOptions& options,
                            Light& light);

/// Of memory, what it holds at most beside an operator with so many columns.
std::size_t BytesOfIteration(std::size_t columns);

/// The same by gathering sweeps (Hanrahan 1991: SolveHR), which is Jacobi's iteration: the error falls by
/// about the mean reflectance each sweep, so the geometric series of residuals says what is left.
Convergence IterateBySweeps(const RadiosityOperator& radiosity_operator, const IterationOptions& options,
                            Light& light);

}  // namespace radbake
