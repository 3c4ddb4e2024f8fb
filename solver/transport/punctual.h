/// Lights without area as shooters.
#pragma once

#include "solver/scene/scene.h"

namespace radbake {

/// Irradiance at `x` with unit normal `n` for unit intensity, unoccluded: cos θ·attenuation/d² of a point or
/// a spot, cos θ of a directional light. Not negative; any consistent unit of length.
double PunctualKernel(const PunctualLight& light, const Vec3& x, const Vec3& n);

/// The far end of a shadow ray from `x`: the light, or a point towards it beyond a unit-sized scene.
Vec3 ShadowRayEnd(const PunctualLight& light, const Vec3& x);

}  // namespace radbake
