/// Where the bake is measured: places spread evenly over the diffuse surfaces.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "solver/check/path_tracer.h"

namespace radbake {

/// Draws `count` places uniformly by area over all sides that reflect, one from each of `count` strips of
/// equal area, in the order of the strips: neighbours in the result are mostly neighbours in the scene.
/// Throws InputError if no side reflects (every material is a blocker).
std::vector<Place> DrawProbes(const TracedScene& scene, std::size_t count, std::uint64_t stream);

}  // namespace radbake
