#include "solver/gltf/baked_primitive.h"

#include <algorithm>
#include <numbers>
#include <utility>

namespace radbake::gltf {
namespace {

/// `width` numbers of vertex i, as the weighted sum of its sources. Exact for dyadic weights, so that
/// elements that share an edge get the same bits.
void Interpolate(const BakedVertex& vertex, const float* values, std::size_t stride, std::size_t width,
                 double* result) {
  std::fill_n(result, width, 0.0);
  for (std::size_t k = 0; k < vertex.source.size(); ++k) {
    if (vertex.weight[k] != 0) {
      for (std::size_t i = 0; i < width; ++i) {
        result[i] += static_cast<double>(vertex.weight[k]) * values[vertex.source[k] * stride + i];
      }
    }
  }
}

const float* Floats(const std::vector<Eigen::Vector3f>& vectors) {
  return vectors.front().data();
}

void Append(std::vector<float>& values, const Vec3& vector) {
  for (const double value : vector) {
    values.push_back(static_cast<float>(value));
  }
}

std::vector<float> Positions(const Geometry& geometry, const BakedMesh& baked) {
  std::vector<float> values;
  values.reserve(3 * baked.vertices.size());
  for (const BakedVertex& vertex : baked.vertices) {
    Vec3 position;
    Interpolate(vertex, Floats(geometry.positions), 3, 3, position.data());
    Append(values, position);
  }
  return values;
}

/// Normals that cancel out leave that of the first source.
std::vector<float> Normals(const Geometry& geometry, const BakedMesh& baked, Side side) {
  std::vector<float> values;
  values.reserve(3 * baked.vertices.size());
  for (const BakedVertex& vertex : baked.vertices) {
    Vec3 normal;
    Interpolate(vertex, Floats(geometry.normals), 3, 3, normal.data());
    if (normal.norm() < 1e-6) {
      normal = geometry.normals[vertex.source[0]].cast<double>();
    }
    Append(values, (side == Side::kBack ? -1 : 1) * normal.normalized());
  }
  return values;
}

/// A unit vector and the handedness of the bitangent, which stays where it is when the normal turns round.
std::vector<float> Tangents(const Geometry& geometry, const Column& column, const BakedMesh& baked,
                            Side side) {
  std::vector<float> values;
  values.reserve(4 * baked.vertices.size());
  for (const BakedVertex& vertex : baked.vertices) {
    Eigen::Vector4d tangent;
    Interpolate(vertex, geometry.attributes.data() + column.offset, geometry.width, 4, tangent.data());
    Vec3 direction = tangent.head<3>();
    if (direction.stableNorm() < 1e-6) {
      direction = Vec3::UnitX();
    }
    Append(values, direction.stableNormalized());
    values.push_back((tangent[3] < 0) == (side == Side::kBack) ? 1.0F : -1.0F);
  }
  return values;
}

std::vector<float> Values(const Geometry& geometry, const Column& column, const BakedMesh& baked) {
  std::vector<float> values;
  values.reserve(column.width * baked.vertices.size());
  std::vector<double> value(column.width);
  for (const BakedVertex& vertex : baked.vertices) {
    Interpolate(vertex, geometry.attributes.data() + column.offset, geometry.width, column.width,
                value.data());
    for (const double component : value) {
      values.push_back(static_cast<float>(component));
    }
  }
  return values;
}

bool IsEmitter(const Material& material) {
  return (material.emission > 0).any();
}

std::vector<float> Colors(const BakedMesh& baked, const Material& material, double exposure) {
  std::vector<float> values;
  values.reserve(3 * baked.vertices.size());
  for (const BakedVertex& vertex : baked.vertices) {
    Rgb radiance = vertex.irradiance.cast<double>() / std::numbers::pi;
    if (IsEmitter(material)) {
      radiance = material.emission + material.reflectance * radiance;
    }
    Append(values, (radiance * exposure).max(0.0).min(1.0).matrix());
  }
  return values;
}

std::vector<float> Irradiance(const BakedMesh& baked) {
  std::vector<float> values;
  values.reserve(3 * baked.vertices.size());
  for (const BakedVertex& vertex : baked.vertices) {
    values.insert(values.end(), vertex.irradiance.begin(), vertex.irradiance.end());
  }
  return values;
}

/// World winding back to that of the mesh's own space, which a mirroring node turns round again.
std::vector<std::uint32_t> Corners(const BakedMesh& baked, bool mirrored) {
  std::vector<std::uint32_t> corners;
  corners.reserve(3 * baked.triangles.size());
  for (Triangle triangle : baked.triangles) {
    if (mirrored) {
      std::swap(triangle[1], triangle[2]);
    }
    corners.insert(corners.end(), triangle.begin(), triangle.end());
  }
  return corners;
}

void EraseExtension(Json& object, const char* name) {
  const auto extensions = object.find("extensions");
  if (extensions != object.end()) {
    extensions->erase(name);
    if (extensions->empty()) {
      object.erase("extensions");
    }
  }
}

}  // namespace

Json MakePrimitive(const Json& original, const Placement& placement, const BakedMesh& baked, Side side,
                   const Material& material, double exposure, Packer& packer) {
  const Geometry& geometry = *placement.geometry;
  Json attributes = {{"POSITION", packer.AddVertices(Positions(geometry, baked), 3, Packer::Bounds::kYes)},
                     {"COLOR_0", packer.AddVertices(Colors(baked, material, exposure), 3)},
                     {"_IRRADIANCE", packer.AddVertices(Irradiance(baked), 3)}};
  if (!geometry.normals.empty()) {
    attributes["NORMAL"] = packer.AddVertices(Normals(geometry, baked, side), 3);
  }
  for (const Column& column : geometry.columns) {
    attributes[column.name] = packer.AddVertices(
        column.name == "TANGENT" ? Tangents(geometry, column, baked, side) : Values(geometry, column, baked),
        column.width);
  }
  Json primitive = original;
  primitive["attributes"] = std::move(attributes);
  primitive["indices"] = packer.AddIndices(Corners(baked, placement.mirrored), baked.vertices.size());
  primitive.erase("mode");
  primitive.erase("material");
  EraseExtension(primitive, "KHR_draco_mesh_compression");
  return primitive;
}

Json MakeUnlit(const Json& original, const Material& material) {
  Json unlit = original;
  unlit["extensions"]["KHR_materials_unlit"] = Json::object();
  unlit.erase("doubleSided");
  if (IsEmitter(material)) {
    // An unlit material shows no emission of its own, so COLOR_0 holds all of the radiance, and nothing
    // scales it. The texture of one that is not opaque stays: it holds the shape.
    Json& base = unlit["pbrMetallicRoughness"];
    Json& factor = base["baseColorFactor"];
    factor = {1, 1, 1, factor.is_array() ? factor[3] : Json(1)};
    if (unlit.value("alphaMode", "OPAQUE") == "OPAQUE") {
      base.erase("baseColorTexture");
    }
    unlit.erase("emissiveFactor");
    unlit.erase("emissiveTexture");
    EraseExtension(unlit, "KHR_materials_emissive_strength");
  }
  return unlit;
}

}  // namespace radbake::gltf
