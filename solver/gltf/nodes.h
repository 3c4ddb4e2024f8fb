/// The node tree: local transforms, children, and the roots of the scene that is baked.
#pragma once

#include "solver/gltf/layout.h"

namespace radbake::gltf {

/// Reads nodes and roots into a layout whose meshes are there already. Throws InputError for a node with two
/// parents, a cycle, a root that is a child, and a transform that is not finite.
void CheckNodes(const Json& root, const Limits& limits, Layout& layout);

/// A node of the baked scene with its transform to world space.
struct Placed {
  std::size_t node = 0;
  Eigen::Matrix4d world = Eigen::Matrix4d::Identity();
};

/// All nodes of the baked scene, parents before their children. Throws InputError where a transform
/// overflows.
std::vector<Placed> PlaceNodes(const Layout& layout);

}  // namespace radbake::gltf
