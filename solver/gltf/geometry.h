/// The triangles of one primitive in its own space, welded: what its placements in the world share.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "solver/gltf/layout.h"
#include "solver/scene/types.h"

namespace radbake::gltf {

/// An interpolated attribute: floats [offset, offset + width) of each vertex.
struct Column {
  std::string name;
  std::size_t offset = 0;
  std::size_t width = 0;
};

/// No two vertices have the same position, normal and attributes, bit by bit.
struct Geometry {
  std::vector<Eigen::Vector3f> positions;  ///< finite
  std::vector<Eigen::Vector3f> normals;    ///< unit length, or empty
  std::vector<Column> columns;
  std::size_t width = 0;            ///< of all columns together
  std::vector<float> attributes;    ///< finite, `width` a vertex
  std::vector<Triangle> triangles;  ///< as the file winds them; strips and fans undone
};

/// Whether a bake carries the attribute to its new vertices. Not so the two of its own output, COLOR_0 and
/// _IRRADIANCE, and not the joints and weights of a skin, which a placement without a skin does not use.
bool IsCarried(std::string_view attribute);

/// `primitive` must draw triangles and have POSITION. Throws InputError for an index beyond the vertices and
/// for a number that is not finite.
Geometry ReadGeometry(const Layout& layout, const Primitive& primitive, const Place& place);

/// The source vertices of each triangle (not welded): indices, strips and fans undone. Throws InputError.
std::vector<Triangle> ReadTriangles(const Layout& layout, const Primitive& primitive, const Place& place);

/// Numbers the vertices that triangles use from 0 up, and returns which ones they were, rising. Many
/// primitives may share one long accessor: no work may grow with the accessor.
std::vector<Index> CompactVertices(std::vector<Triangle>& triangles);

}  // namespace radbake::gltf
