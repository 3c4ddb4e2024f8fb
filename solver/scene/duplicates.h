/// Triangles that a scene has twice.
#pragma once

#include <cstddef>

#include "solver/scene/scene.h"

namespace radbake {

/// Removes every triangle that has the same three corners, bit by bit, as an earlier one that faces every way
/// that it does: light would count both. One that looks the other way stays: the two are a sheet's two sides.
/// Returns how many were removed.
///
/// Surfaces that lie in one plane and overlap without being the same: see Overlaps.
std::size_t DropDuplicates(Scene& scene);

}  // namespace radbake
