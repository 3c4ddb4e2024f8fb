/// Materials of a glTF as the transport sees them.
#pragma once

#include <optional>

#include "solver/gltf/json.h"
#include "solver/scene/scene.h"

namespace radbake::gltf {

/// The most of any factor, radiance or intensity: squares of what is brighter overflow in single precision.
constexpr double kBrightest = 1e18;

/// The scene's material for one of the glTF's, or for the default material of a primitive that names none.
/// Adds to the scene's ignored features and warnings what it does not use. Throws InputError for a factor
/// that is negative or too large to compute with.
Material ImportMaterial(const Json& root, std::optional<std::size_t> index, Scene& scene);

/// Notes a feature that is not used, in both of the scene's lists.
void Ignore(Scene& scene, const std::string& feature, const std::string& reason);

}  // namespace radbake::gltf
