/// Lights without area: KHR_lights_punctual.
#pragma once

#include "solver/gltf/layout.h"
#include "solver/scene/scene.h"

namespace radbake::gltf {

/// Adds each light of the document to scene.lights once for every node of the baked scene that uses it: at
/// the node's origin, along its −Z. Of the node's scale nothing changes it but a mirroring, which mirrors its
/// light. Lights of no intensity are left out. Throws InputError for values out of range, in lights that are
/// not used too, and for an index beyond them.
void ImportLights(const Json& root, const Layout& layout, Scene& scene);

}  // namespace radbake::gltf
