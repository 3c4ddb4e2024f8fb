/// What a bake says the irradiance is at given places.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "solver/bake/baked_scene.h"
#include "solver/check/path_tracer.h"

namespace radbake {

/// The irradiance in lx at each place: linear over the nearest baked triangle that faces the same way.
/// Nothing where no such triangle is within 1e-4 of the scene's size.
std::vector<std::optional<Rgb>> LookUp(const BakedTriangles& baked, const UnitBox& normalization,
                                       std::span<const Place> places);

}  // namespace radbake
