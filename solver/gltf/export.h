/// From the baked scene back to a glTF.
#pragma once

#include <string>

#include "solver/bake/baked_scene.h"
#include "solver/gltf/file.h"
#include "solver/gltf/import.h"

namespace radbake::gltf {

/// The file with its surfaces baked, as one .glb (Document::Export).
std::string Export(const File& file, const Source& source, const Imported& imported, const BakedScene& baked);

}  // namespace radbake::gltf
