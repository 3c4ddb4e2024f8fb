/// What of a glTF's features the bake does not use, by name.
#pragma once

#include "solver/gltf/layout.h"
#include "solver/scene/scene.h"

namespace radbake::gltf {

/// Throws InputError that names a required extension without which the geometry or the colours of the scene
/// would be others.
void CheckRequiredExtensions(const Json& root);

/// Notes animations, skinned meshes, points and lines, attributes, other scenes and unknown
/// extensions. Materials are noted where they are imported.
void IgnoreFeatures(const Json& root, const Layout& layout, Scene& scene);

/// For messages: the kind and name of an element of a list, or its number where it has no name: "node
/// 'lamp'".
std::string NameOf(const Json& root, const char* list, std::size_t index);

}  // namespace radbake::gltf
