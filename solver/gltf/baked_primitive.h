/// The vertices of a baked primitive (DESIGN section 4, `vertex`) and the material that shows them.
#pragma once

#include "solver/bake/baked_scene.h"
#include "solver/gltf/import.h"
#include "solver/gltf/packer.h"

namespace radbake::gltf {

enum class Side { kFront, kBack };

/// `original` with the baked vertices and triangles in place of its own, and without a material. All vertex
/// data is float, in the space of the mesh. COLOR_0 is E/π × exposure, or the whole outgoing radiance ×
/// exposure of an emitter.
Json MakePrimitive(const Json& original, const Placement& placement, const BakedMesh& baked, Side side,
                   const Material& material, double exposure, Packer& packer);

/// `original` made unlit and single-sided. That of an emitter shows COLOR_0 alone.
Json MakeUnlit(const Json& original, const Material& material);

}  // namespace radbake::gltf
