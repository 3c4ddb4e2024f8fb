/// What the bake reads of a glTF: buffers, accessors, meshes and the node tree, with every index, range and
/// count checked once, so that nothing after it needs to.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "solver/gltf/document.h"
#include "solver/gltf/json.h"

namespace radbake::gltf {

enum class Component : std::uint16_t {
  kInt8 = 5120,
  kUint8 = 5121,
  kInt16 = 5122,
  kUint16 = 5123,
  kUint32 = 5125,
  kFloat = 5126
};
std::size_t SizeOf(Component component);

struct View {
  std::size_t buffer = 0;
  std::size_t offset = 0;
  std::size_t length = 0;
  std::size_t stride = 0;  ///< 0: elements stand close together
};

/// Values that replace single elements; indices rise strictly and are below the accessor's count.
struct Sparse {
  std::size_t count = 0;
  Component index_component = Component::kUint8;
  std::string_view indices;
  std::string_view values;
};

/// A checked accessor: element i stands at bytes[i × stride] (all zeros if `bytes` is empty).
struct Accessor {
  std::string_view bytes;
  std::size_t stride = 0;
  std::size_t count = 0;
  Component component = Component::kFloat;
  std::size_t rows = 1;
  std::size_t columns = 1;        ///< above 1 for matrices
  std::size_t column_stride = 0;  ///< bytes; a matrix's columns start at multiples of 4
  bool normalized = false;
  std::optional<Sparse> sparse;

  std::size_t Width() const { return rows * columns; }
};

enum class Mode { kPoints, kLines, kLineLoop, kLineStrip, kTriangles, kStrip, kFan };

struct Primitive {
  Mode mode = Mode::kTriangles;
  std::optional<std::size_t> indices;
  std::optional<std::size_t> material;
  std::vector<std::pair<std::string, std::size_t>> attributes;  ///< by name, all of the same count

  /// The accessor of an attribute.
  std::optional<std::size_t> Find(std::string_view name) const;
  /// Vertices drawn, and what they make (0 for points and lines).
  std::size_t Corners(const std::vector<Accessor>& accessors) const;
  std::size_t Triangles(const std::vector<Accessor>& accessors) const;
};

struct Mesh {
  std::vector<Primitive> primitives;
  bool morphs = false;
};

struct Node {
  std::optional<std::size_t> mesh;
  std::vector<std::size_t> children;
  bool skinned = false;
  bool instanced = false;  ///< EXT_mesh_gpu_instancing
  Eigen::Matrix4d local = Eigen::Matrix4d::Identity();
};

struct Layout {
  std::vector<View> views;
  std::vector<Accessor> accessors;
  std::vector<Mesh> meshes;
  std::vector<Node> nodes;
  std::vector<std::size_t> roots;  ///< of the scene that is baked
};

/// Throws InputError with the place named. `buffers` must outlive the layout.
Layout CheckLayout(const Json& root, const std::vector<std::string_view>& buffers, const Limits& limits);

}  // namespace radbake::gltf
