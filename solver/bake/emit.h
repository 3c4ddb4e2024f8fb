/// The output mesh as baked surfaces: triangles, and vertices as weights of the input's.
#pragma once

#include <optional>

#include "solver/bake/baked_scene.h"
#include "solver/bake/output_mesh.h"

namespace radbake {

/// Irradiance in lx; `exposure` as given, or set so that 98 % of the lit area stay below white.
BakedScene Emit(const Hierarchy& hierarchy, const OutputMesh& mesh, std::size_t surface_count,
                std::optional<double> exposure);

}  // namespace radbake
