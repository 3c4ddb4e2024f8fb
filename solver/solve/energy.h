/// Where the light ends: the energy balance of a solution.
#pragma once

#include "solver/hierarchy/light.h"
#include "solver/solve/solution.h"
#include "solver/transport/visibility.h"

namespace radbake {

/// What leaves the scene and what back sides absorb is counted by rays from the leaves, drawn by the power
/// that they send out, with cosine-weighted directions: nothing of it comes from links. In lm.
EnergyBalance BalanceEnergy(const Hierarchy& hierarchy, const Light& light, const Visibility& visibility);

}  // namespace radbake
