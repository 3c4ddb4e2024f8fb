/// The operator B ↦ π·L_e + ρ·K·B on the hierarchy: gather over links, then push-pull (Hanrahan 1991,
/// section 3.3: GatherRad and PushPullRad).
#pragma once

#include "solver/hierarchy/light.h"
#include "solver/solve/rows.h"

namespace radbake {

/// Applies it once to `light` in place: each leaf gathers along its row (its links and its ancestors', pushed
/// down to it), and radiosity, irradiance and variation are pulled up as means by area. Returns the residual
/// of what `light` held before,
///   ‖π·L_e + ρ·K·B − B‖ / ‖B‖, by leaf area and channel.
/// The same bits on any number of threads.
double ApplyRadiosityOperator(const Hierarchy& hierarchy, const Rows& rows, Light& light);

}  // namespace radbake
