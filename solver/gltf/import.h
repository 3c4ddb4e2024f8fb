/// From a checked glTF to the scene, with what the way back needs to know.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "solver/gltf/geometry.h"
#include "solver/gltf/layout.h"
#include "solver/gltf/nodes.h"
#include "solver/scene/scene.h"

namespace radbake::gltf {

/// Where a surface of the scene comes from.
struct Placement {
  std::size_t node = 0;
  std::size_t mesh = 0;
  std::size_t primitive = 0;
  std::shared_ptr<const Geometry> geometry;  ///< shared by all placements of the primitive
  bool mirrored = false;                     ///< the node's transform turns the winding round
};

struct Imported {
  Scene scene;
  std::vector<Placement> placements;  ///< parallel to scene.surfaces
};

/// Throws InputError.
Imported Import(const Json& root, const Layout& layout, const Limits& limits);

/// Why the primitives of a node stay as they are: a skin, morph targets or instances. Empty: they do not.
std::string_view StaysAsItIs(const Layout& layout, const Node& node);

/// Calls `visit` for each primitive of triangles that stands in the baked scene and does not stay as it is,
/// with its node's transform to world space. Throws InputError beyond the limits.
void ForEachDrawing(const Layout& layout, const Limits& limits,
                    const std::function<void(const Placed& placed, std::size_t primitive)>& visit);

/// A position of the file in world space. Throws InputError for one that is too far out to compute with.
Vec3 ToWorld(const Eigen::Matrix4d& world, const Eigen::Vector3f& position, std::size_t node);

/// Whether the transform turns counter-clockwise into clockwise.
bool Mirrors(const Eigen::Matrix4d& world);

}  // namespace radbake::gltf
