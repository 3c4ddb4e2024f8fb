#include "solver/gltf/geometry.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "solver/gltf/accessor.h"

namespace radbake::gltf {
namespace {

constexpr std::size_t kPositionWidth = 3;

/// One row of floats a vertex: position, normal if there is one, attributes.
class Rows {
 public:
  Rows(std::size_t width, std::size_t count) : width_(width), values_(width * count) {}
  float* operator[](std::size_t row) { return values_.data() + row * width_; }
  const float* operator[](std::size_t row) const { return values_.data() + row * width_; }

  std::uint64_t Hash(std::size_t row) const {
    std::uint64_t hash = 0xCBF29CE484222325U;
    for (std::size_t i = 0; i < width_; ++i) {
      hash = (hash ^ std::bit_cast<std::uint32_t>((*this)[row][i])) * 0x100000001B3U;
      hash ^= hash >> 29U;
    }
    return hash;
  }
  int Compare(std::size_t a, std::size_t b) const {
    return std::memcmp((*this)[a], (*this)[b], width_ * sizeof(float));
  }

 private:
  std::size_t width_;
  std::vector<float> values_;
};

/// For each row the first row of the same bits. Sorted by hash and then by bits, so that no choice of values
/// makes it slow.
std::vector<Index> FirstsOfTheirKind(const Rows& rows, std::size_t count) {
  struct Entry {
    std::uint64_t hash;
    Index row;
  };
  std::vector<Entry> entries;
  entries.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    entries.push_back({rows.Hash(i), static_cast<Index>(i)});
  }
  std::sort(entries.begin(), entries.end(), [&](const Entry& a, const Entry& b) {
    if (a.hash != b.hash) {
      return a.hash < b.hash;
    }
    const int order = rows.Compare(a.row, b.row);
    return order != 0 ? order < 0 : a.row < b.row;
  });
  std::vector<Index> firsts(count);
  for (std::size_t i = 0; i < count; ++i) {
    const bool same = i > 0 && entries[i].hash == entries[i - 1].hash &&
                      rows.Compare(entries[i].row, entries[i - 1].row) == 0;
    firsts[entries[i].row] = same ? firsts[entries[i - 1].row] : entries[i].row;
  }
  return firsts;
}

/// Makes normals unit length; one of length zero becomes that of the triangles around it.
void RepairNormals(Geometry& geometry) {
  std::vector<Vec3> around;
  for (std::size_t v = 0; v < geometry.normals.size(); ++v) {
    Vec3 normal = geometry.normals[v].cast<double>();
    if (normal.stableNorm() == 0) {
      if (around.empty()) {
        around.assign(geometry.positions.size(), Vec3::Zero());
        for (const Triangle& triangle : geometry.triangles) {
          const Vec3 a = geometry.positions[triangle[0]].cast<double>();
          const Vec3 b = geometry.positions[triangle[1]].cast<double>();
          const Vec3 c = geometry.positions[triangle[2]].cast<double>();
          for (const Index corner : triangle) {
            around[corner] += (b - a).cross(c - a);
          }
        }
      }
      normal = around[v].stableNorm() > 0 ? around[v] : Vec3::UnitZ();
    }
    geometry.normals[v] = normal.stableNormalized().cast<float>();
  }
}

}  // namespace

bool IsCarried(std::string_view attribute) {
  return attribute != "POSITION" && attribute != "NORMAL" && attribute != "COLOR_0" &&
         attribute != "_IRRADIANCE" && !attribute.starts_with("JOINTS_") &&
         !attribute.starts_with("WEIGHTS_");
}

std::vector<Triangle> ReadTriangles(const Layout& layout, const Primitive& primitive, const Place& place) {
  const std::size_t vertices = layout.accessors[*primitive.Find("POSITION")].count;
  const auto corner = [&](std::size_t i) {
    const std::size_t vertex = primitive.indices ? ReadIndex(layout.accessors[*primitive.indices], i) : i;
    if (vertex >= vertices) {
      Fail(place,
           "index " + std::to_string(vertex) + " is beyond its " + std::to_string(vertices) + " vertices");
    }
    return static_cast<Index>(vertex);
  };
  const std::size_t count = primitive.Triangles(layout.accessors);
  std::vector<Triangle> triangles;
  triangles.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    switch (primitive.mode) {
      case Mode::kStrip:
        triangles.push_back({corner(i), corner(i + 1 + i % 2), corner(i + 2 - i % 2)});
        break;
      case Mode::kFan:
        triangles.push_back({corner(i + 1), corner(i + 2), corner(0)});
        break;
      default:
        triangles.push_back({corner(3 * i), corner(3 * i + 1), corner(3 * i + 2)});
    }
  }
  return triangles;
}

std::vector<Index> CompactVertices(std::vector<Triangle>& triangles) {
  std::vector<Index> used;
  used.reserve(3 * triangles.size());
  for (const Triangle& triangle : triangles) {
    used.insert(used.end(), triangle.begin(), triangle.end());
  }
  std::sort(used.begin(), used.end());
  used.erase(std::unique(used.begin(), used.end()), used.end());
  for (Triangle& triangle : triangles) {
    for (Index& corner : triangle) {
      corner = static_cast<Index>(std::lower_bound(used.begin(), used.end(), corner) - used.begin());
    }
  }
  return used;
}

Geometry ReadGeometry(const Layout& layout, const Primitive& primitive, const Place& place) {
  Geometry geometry;
  geometry.triangles = ReadTriangles(layout, primitive, place);
  const bool has_normals = primitive.Find("NORMAL").has_value();
  const std::size_t first_column = has_normals ? 2 * kPositionWidth : kPositionWidth;
  for (const auto& [name, accessor] : primitive.attributes) {
    if (IsCarried(name)) {
      geometry.columns.push_back({name, geometry.width, layout.accessors[accessor].Width()});
      geometry.width += geometry.columns.back().width;
    }
  }

  const std::vector<Index> sources = CompactVertices(geometry.triangles);
  Rows rows(first_column + geometry.width, sources.size());
  const auto read = [&](const std::string& name, std::size_t offset) {
    const Accessor& accessor = layout.accessors[*primitive.Find(name)];
    for (std::size_t i = 0; i < sources.size(); ++i) {
      float* values = rows[i] + offset;
      ReadElement(accessor, sources[i], values);
      for (std::size_t k = 0; k < accessor.Width(); ++k) {
        if (!std::isfinite(values[k])) {
          Fail(place, Quoted(name) + " of vertex " + std::to_string(sources[i]) + " is not a finite number");
        }
        values[k] += 0.0F;  // −0 becomes +0: the same place has the same bits
      }
    }
  };
  read("POSITION", 0);
  if (has_normals) {
    read("NORMAL", kPositionWidth);
  }
  for (const Column& column : geometry.columns) {
    read(column.name, first_column + column.offset);
  }

  const std::vector<Index> firsts = FirstsOfTheirKind(rows, sources.size());
  std::vector<Index> welded(sources.size());
  for (std::size_t i = 0; i < sources.size(); ++i) {
    if (firsts[i] != i) {
      welded[i] = welded[firsts[i]];
      continue;
    }
    welded[i] = static_cast<Index>(geometry.positions.size());
    geometry.positions.emplace_back(rows[i]);
    if (has_normals) {
      geometry.normals.emplace_back(rows[i] + kPositionWidth);
    }
    geometry.attributes.insert(geometry.attributes.end(), rows[i] + first_column,
                               rows[i] + first_column + geometry.width);
  }
  for (Triangle& triangle : geometry.triangles) {
    for (Index& corner : triangle) {
      corner = welded[corner];
    }
  }
  RepairNormals(geometry);
  return geometry;
}

}  // namespace radbake::gltf
