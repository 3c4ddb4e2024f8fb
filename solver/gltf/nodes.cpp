#include "solver/gltf/nodes.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <ranges>

namespace radbake::gltf {
namespace {

Eigen::Matrix4d LocalTransform(const Json& node, const Place& place) {
  Eigen::Matrix4d local = Eigen::Matrix4d::Identity();
  if (const auto matrix = FindNumbers<16>(node, "matrix", place)) {
    local = Eigen::Map<const Eigen::Matrix4d>(matrix->data());  // both are in column-major order
  } else {
    if (const auto scale = FindNumbers<3>(node, "scale", place)) {
      local.diagonal().head<3>() = Eigen::Map<const Eigen::Vector3d>(scale->data());
    }
    if (const auto rotation = FindNumbers<4>(node, "rotation", place)) {
      const Eigen::Map<const Eigen::Vector4d> xyzw(rotation->data());
      if (xyzw.stableNorm() == 0) {
        Fail(place, "rotation is zero");
      }
      const Eigen::Quaterniond quaternion(Eigen::Vector4d(xyzw.stableNormalized()));
      local.topLeftCorner<3, 3>() = quaternion.toRotationMatrix() * local.topLeftCorner<3, 3>();
    }
    if (const auto translation = FindNumbers<3>(node, "translation", place)) {
      local.topRightCorner<3, 1>() = Eigen::Map<const Eigen::Vector3d>(translation->data());
    }
  }
  if (!local.allFinite()) {
    Fail(place, "transform is not finite");
  }
  if (!local.row(3).isApprox(Eigen::RowVector4d(0, 0, 0, 1), 1e-6)) {
    Fail(place, "matrix is not affine");
  }
  local.row(3) = Eigen::RowVector4d(0, 0, 0, 1);
  return local;
}

void CheckTree(const std::vector<Node>& nodes) {
  std::vector<std::size_t> parents(nodes.size(), Place::kWhole);
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    for (const std::size_t child : nodes[i].children) {
      if (parents[child] != Place::kWhole) {
        Fail({"node", child},
             "has two parents, nodes " + std::to_string(parents[child]) + " and " + std::to_string(i));
      }
      parents[child] = i;
    }
  }
  // With one parent at most, what no root reaches goes round in a circle.
  std::vector<std::size_t> open;
  std::vector<bool> reached(nodes.size(), false);
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    if (parents[i] == Place::kWhole) {
      open.push_back(i);
    }
  }
  while (!open.empty()) {
    const std::size_t node = open.back();
    open.pop_back();
    reached[node] = true;
    open.insert(open.end(), nodes[node].children.begin(), nodes[node].children.end());
  }
  if (const auto lost = std::find(reached.begin(), reached.end(), false); lost != reached.end()) {
    Fail({"node", static_cast<std::size_t>(lost - reached.begin())}, "is in a cycle");
  }
}

void CheckRoots(const Json& root, Layout& layout) {
  const Place whole{"glTF"};
  std::vector<bool> is_child(layout.nodes.size(), false);
  for (const Node& node : layout.nodes) {
    for (const std::size_t child : node.children) {
      is_child[child] = true;
    }
  }
  const Json& scenes = Objects(root, "scenes", whole);
  const std::optional<std::size_t> scene = FindIndex(root, "scene", scenes.size(), whole);
  for (std::size_t i = 0; i < scenes.size(); ++i) {
    const std::vector<std::size_t> roots = Indices(scenes[i], "nodes", layout.nodes.size(), {"scene", i});
    for (const std::size_t node : roots) {
      if (is_child[node]) {
        Fail({"scene", i}, "node " + std::to_string(node) + " is not a root");
      }
    }
    if (i == scene.value_or(0)) {
      layout.roots = roots;
    }
  }
  for (std::size_t i = 0; scenes.empty() && i < layout.nodes.size(); ++i) {
    if (!is_child[i]) {
      layout.roots.push_back(i);
    }
  }
}

}  // namespace

void CheckNodes(const Json& root, const Limits& limits, Layout& layout) {
  const Place whole{"glTF"};
  const Json& nodes = Objects(root, "nodes", whole);
  if (nodes.size() > limits.nodes) {
    Fail(whole,
         std::to_string(nodes.size()) + " nodes are more than the limit of " + std::to_string(limits.nodes));
  }
  const std::size_t skins = Objects(root, "skins", whole).size();
  const std::size_t cameras = Objects(root, "cameras", whole).size();
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const Place place{"node", i};
    Node& node = layout.nodes.emplace_back();
    node.mesh = FindIndex(nodes[i], "mesh", layout.meshes.size(), place);
    node.skinned = FindIndex(nodes[i], "skin", skins, place).has_value();
    FindIndex(nodes[i], "camera", cameras, place);
    node.instanced = FindExtension(nodes[i], "EXT_mesh_gpu_instancing", place) != nullptr;
    node.children = Indices(nodes[i], "children", nodes.size(), place);
    node.local = LocalTransform(nodes[i], place);
  }
  CheckTree(layout.nodes);
  CheckRoots(root, layout);
}

std::vector<Placed> PlaceNodes(const Layout& layout) {
  std::vector<Placed> placed;
  std::vector<Placed> open;
  const auto push = [&](const std::vector<std::size_t>& nodes, const Eigen::Matrix4d& parent) {
    for (const std::size_t node : nodes | std::views::reverse) {
      open.push_back({node, parent * layout.nodes[node].local});
      if (!open.back().world.allFinite()) {
        Fail({"node", node}, "transform to world space is not finite");
      }
    }
  };
  push(layout.roots, Eigen::Matrix4d::Identity());
  while (!open.empty()) {
    placed.push_back(open.back());
    open.pop_back();
    push(layout.nodes[placed.back().node].children, placed.back().world);
  }
  return placed;
}

}  // namespace radbake::gltf
