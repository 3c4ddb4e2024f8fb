/// Elements of a checked accessor as numbers.
#pragma once

#include "solver/gltf/layout.h"

namespace radbake::gltf {

/// Entry `i` of the sparse indices.
std::size_t ReadSparseIndex(const Sparse& sparse, std::size_t i);

/// Writes element `i` (below the count), Width() floats: integers as they are, or to [0, 1] or [-1, 1] if
/// normalized. A float of the file may be anything, NaN too.
void ReadElement(const Accessor& accessor, std::size_t i, float* element);

/// Element `i` of an accessor of unsigned scalars.
std::uint32_t ReadIndex(const Accessor& accessor, std::size_t i);

}  // namespace radbake::gltf
