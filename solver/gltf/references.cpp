#include "solver/gltf/references.h"

#include <array>

namespace radbake::gltf {
namespace {

// J is Json where the document is to be changed, else const Json.
template <class J>
using Visit = std::function<void(J&, Target, const Place&)>;

template <class J>
J* List(J& object, const char* key, const Place& place) {
  Objects(object, key, place);
  return Find(object, key);
}

template <class J>
J* Child(J* object, const char* key, const Place& place) {
  if (object == nullptr) {
    return nullptr;
  }
  FindObject(*object, key, place);
  return Find(*object, key);
}

template <class J>
void Member(J* object, const char* key, Target target, const Place& place, const Visit<J>& visit) {
  if (object != nullptr) {
    if (J* index = Find(*object, key)) {
      visit(*index, target, place);
    }
  }
}

/// An object from attribute names to accessors.
template <class J>
void Attributes(J* attributes, const Place& place, const Visit<J>& visit) {
  if (attributes != nullptr) {
    for (auto& attribute : attributes->items()) {
      visit(attribute.value(), Target::kAccessor, place);
    }
  }
}

template <class J>
void Meshes(J& root, const Visit<J>& visit) {
  J* meshes = List(root, "meshes", {"glTF"});
  for (std::size_t m = 0; meshes != nullptr && m < meshes->size(); ++m) {
    J* primitives = List((*meshes)[m], "primitives", {"mesh", m});
    for (std::size_t p = 0; primitives != nullptr && p < primitives->size(); ++p) {
      J& primitive = (*primitives)[p];
      const Place place{"mesh", m, "primitive", p};
      Attributes(Child(&primitive, "attributes", place), place, visit);
      Member(&primitive, "indices", Target::kAccessor, place, visit);
      J* targets = List(primitive, "targets", place);
      for (std::size_t t = 0; targets != nullptr && t < targets->size(); ++t) {
        Attributes(&(*targets)[t], place, visit);
      }
      Member(Child(Child(&primitive, "extensions", place), "KHR_draco_mesh_compression", place), "bufferView",
             Target::kBufferView, place, visit);
    }
  }
}

template <class J>
void Walk(J& root, const Visit<J>& visit) {
  const Place whole{"glTF"};
  Meshes(root, visit);
  J* skins = List(root, "skins", whole);
  for (std::size_t i = 0; skins != nullptr && i < skins->size(); ++i) {
    Member(&(*skins)[i], "inverseBindMatrices", Target::kAccessor, {"skin", i}, visit);
  }
  J* animations = List(root, "animations", whole);
  for (std::size_t i = 0; animations != nullptr && i < animations->size(); ++i) {
    J* samplers = List((*animations)[i], "samplers", {"animation", i});
    for (std::size_t s = 0; samplers != nullptr && s < samplers->size(); ++s) {
      const Place place{"animation", i, "sampler", s};
      Member(&(*samplers)[s], "input", Target::kAccessor, place, visit);
      Member(&(*samplers)[s], "output", Target::kAccessor, place, visit);
    }
  }
  J* nodes = List(root, "nodes", whole);
  for (std::size_t i = 0; nodes != nullptr && i < nodes->size(); ++i) {
    const Place place{"node", i};
    J* instancing = Child(Child(&(*nodes)[i], "extensions", place), "EXT_mesh_gpu_instancing", place);
    Attributes(Child(instancing, "attributes", place), place, visit);
  }
  J* images = List(root, "images", whole);
  for (std::size_t i = 0; images != nullptr && i < images->size(); ++i) {
    Member(&(*images)[i], "bufferView", Target::kBufferView, {"image", i}, visit);
  }
  J* accessors = List(root, "accessors", whole);
  for (std::size_t i = 0; accessors != nullptr && i < accessors->size(); ++i) {
    J& accessor = (*accessors)[i];
    const Place place{"accessor", i};
    Member(&accessor, "bufferView", Target::kBufferView, place, visit);
    J* sparse = Child(&accessor, "sparse", place);
    Member(Child(sparse, "indices", place), "bufferView", Target::kBufferView, place, visit);
    Member(Child(sparse, "values", place), "bufferView", Target::kBufferView, place, visit);
  }
}

}  // namespace

void ForEachReference(Json& root, const std::function<void(Json&, Target, const Place&)>& visit) {
  Walk<Json>(root, visit);
}

void ForEachReference(const Json& root, const std::function<void(const Json&, Target, const Place&)>& visit) {
  Walk<const Json>(root, visit);
}

void CheckReferences(const Json& root, std::size_t accessors, std::size_t views) {
  ForEachReference(root, [&](const Json& index, Target target, const Place& place) {
    const bool accessor = target == Target::kAccessor;
    const std::size_t size = accessor ? accessors : views;
    if (!index.is_number_unsigned() || index.get<std::size_t>() >= size) {
      Fail(place, std::string(accessor ? "accessor " : "buffer view ") +
                      (index.is_number_unsigned() ? index.dump() : Quoted(index.dump())) +
                      " is not one of the " + std::to_string(size) + " that there are");
    }
  });
}

namespace {

bool IsTransparent(std::string_view extension) {
  constexpr std::array<std::string_view, 11> kKnown = {
      "KHR_lights_punctual",        "KHR_mesh_quantization",   "KHR_texture_transform",
      "KHR_texture_basisu",         "EXT_texture_webp",        "EXT_texture_avif",
      "KHR_draco_mesh_compression", "EXT_mesh_gpu_instancing", "KHR_animation_pointer",
      "EXT_meshopt_compression",    "KHR_xmp_json_ld"};
  for (const std::string_view known : kKnown) {
    if (extension == known) {
      return true;
    }
  }
  return extension.starts_with("KHR_materials_");
}

void Collect(const Json& value, std::set<std::string>& names) {
  if (value.is_object()) {
    for (const auto& member : value.items()) {
      if (member.key() == "extensions" && member.value().is_object()) {
        for (const auto& extension : member.value().items()) {
          if (!IsTransparent(extension.key())) {
            names.insert(extension.key());
          }
        }
      }
      if (member.key() != "extras") {
        Collect(member.value(), names);
      }
    }
  } else if (value.is_array()) {
    for (const Json& element : value) {
      Collect(element, names);
    }
  }
}

}  // namespace

std::set<std::string> OpaqueExtensions(const Json& root) {
  std::set<std::string> names;
  Collect(root, names);
  return names;
}

}  // namespace radbake::gltf
