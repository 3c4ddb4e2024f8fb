/// Small glTF files for tests, made by hand in a few lines.
#pragma once

#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "solver/bake/baked_scene.h"
#include "solver/gltf/document.h"

namespace radbake::gltf {

using Json = nlohmann::json;

/// A glTF under construction: `root` is free to be changed before it is packed.
struct Builder {
  Json root = {{"asset", {{"version", "2.0"}}}, {"scene", 0}, {"scenes", {{{"nodes", {0}}}}}};
  std::string binary;

  std::size_t Add(const char* list, Json element) {
    root[list].push_back(std::move(element));
    return root[list].size() - 1;
  }

  template <class T>
  std::size_t View(const std::vector<T>& values, std::size_t stride = 0) {
    binary.append((4 - binary.size() % 4) % 4, '\0');
    Json view = {{"buffer", 0}, {"byteOffset", binary.size()}, {"byteLength", values.size() * sizeof(T)}};
    if (stride != 0) {
      view["byteStride"] = stride;
    }
    const std::size_t at = binary.size();
    binary.resize(at + values.size() * sizeof(T));
    std::memcpy(binary.data() + at, values.data(), values.size() * sizeof(T));
    return Add("bufferViews", view);
  }

  std::size_t Accessor(std::size_t view, int component, std::size_t count, const char* type) {
    return Add("accessors",
               {{"bufferView", view}, {"componentType", component}, {"count", count}, {"type", type}});
  }
  std::size_t Floats(const std::vector<float>& values, const char* type, std::size_t width) {
    return Accessor(View(values), 5126, values.size() / width, type);
  }
  std::size_t Vec3s(const std::vector<float>& values) { return Floats(values, "VEC3", 3); }
  std::size_t Shorts(const std::vector<std::uint16_t>& values) {
    return Accessor(View(values), 5123, values.size(), "SCALAR");
  }

  /// A mesh of one primitive. Returns its index.
  std::size_t Mesh(Json primitive) { return Add("meshes", {{"primitives", {std::move(primitive)}}}); }

  /// The JSON with its one buffer, and all of it as a .glb.
  Json Root() const {
    Json complete = root;
    if (!binary.empty()) {
      complete["buffers"] = {{{"byteLength", binary.size()}}};
    }
    return complete;
  }
  std::string Glb() const { return Pack(Root().dump(), binary); }

  static std::string Pack(std::string json, std::string binary) {
    const auto word = [](std::size_t value) {
      const auto number = static_cast<std::uint32_t>(value);
      return std::string(reinterpret_cast<const char*>(&number), 4);
    };
    json.append((4 - json.size() % 4) % 4, ' ');
    binary.append((4 - binary.size() % 4) % 4, '\0');
    return "glTF" + word(2) + word(28 + json.size() + binary.size()) + word(json.size()) + "JSON" + json +
           word(binary.size()) + std::string("BIN\0", 4) + binary;
  }
};

/// Node 0 shows mesh 0, one triangle in the plane z = 0, counter-clockwise from +z.
inline Builder OneTriangle() {
  Builder builder;
  const std::size_t positions = builder.Vec3s({0, 0, 0, 1, 0, 0, 0, 1, 0});
  builder.root["accessors"][positions]["min"] = {0, 0, 0};
  builder.root["accessors"][positions]["max"] = {1, 1, 0};
  builder.Mesh({{"attributes", {{"POSITION", positions}}}});
  builder.Add("nodes", {{"mesh", 0}});
  return builder;
}

inline Document Open(const Builder& builder) {
  return Document(Source{builder.Glb(), {}});
}

/// Each surface as it is, with the same irradiance at every vertex; the back of a double-sided one too.
inline BakedScene TrivialBake(const Scene& scene, float lux = 1) {
  BakedScene baked;
  for (const Surface& surface : scene.surfaces) {
    BakedSurface& made = baked.surfaces.emplace_back();
    const Material& material = scene.materials[surface.material];
    if (material.role == Role::kBlocker) {
      continue;
    }
    for (Index i = 0; i < surface.positions.size(); ++i) {
      BakedVertex& vertex = made.front.vertices.emplace_back();
      vertex.source[0] = i;
      vertex.weight[0] = 1;
      vertex.irradiance.setConstant(lux);
    }
    made.front.triangles = surface.triangles;
    if (material.sides == Sides::kBoth) {
      made.back = made.front;
      for (Triangle& triangle : made.back.triangles) {
        std::swap(triangle[1], triangle[2]);
      }
    }
  }
  return baked;
}

/// The JSON and the BIN chunk of a .glb.
struct Unpacked {
  explicit Unpacked(const std::string& glb) {
    std::uint32_t size = 0;
    std::memcpy(&size, glb.data() + 12, 4);
    root = Json::parse(glb.substr(20, size));
    binary = glb.size() > 28 + size ? glb.substr(28 + size) : "";
  }
  Json root;
  std::string binary;

  /// Element `i` of an accessor of floats.
  std::vector<float> Element(const Json& accessor_index, std::size_t i) const {
    const Json& accessor = root["accessors"][accessor_index.get<std::size_t>()];
    const Json& view = root["bufferViews"][accessor["bufferView"].get<std::size_t>()];
    const std::string type = accessor["type"];
    const std::size_t width = type == "SCALAR" ? 1 : static_cast<std::size_t>(type.back() - '0');
    std::vector<float> values(width);
    std::memcpy(values.data(), binary.data() + view["byteOffset"].get<std::size_t>() + i * width * 4,
                width * 4);
    return values;
  }
};

}  // namespace radbake::gltf
