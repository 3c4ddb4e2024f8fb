#include "solver/gltf/features.h"

#include <algorithm>
#include <array>
#include <set>

#include "solver/gltf/import.h"
#include "solver/gltf/materials.h"
#include "solver/gltf/nodes.h"

namespace radbake::gltf {
namespace {

/// Extensions that change neither where triangles are nor the diffuse light between them, or that are
/// imported.
constexpr std::array<std::string_view, 20> kHarmless = {
    "KHR_materials_unlit",       "KHR_materials_emissive_strength",
    "KHR_materials_ior",         "KHR_materials_specular",
    "KHR_materials_clearcoat",   "KHR_materials_sheen",
    "KHR_materials_iridescence", "KHR_materials_anisotropy",
    "KHR_materials_dispersion",  "KHR_materials_transmission",
    "KHR_materials_volume",      "KHR_materials_variants",
    "KHR_mesh_quantization",     "KHR_texture_transform",
    "KHR_texture_basisu",        "EXT_texture_webp",
    "EXT_texture_avif",          "KHR_lights_punctual",
    "KHR_animation_pointer",     "KHR_xmp_json_ld"};

bool IsHarmless(std::string_view name) {
  return std::find(kHarmless.begin(), kHarmless.end(), name) != kHarmless.end();
}

std::vector<std::string> Names(const Json& root, const char* key) {
  std::vector<std::string> names;
  const Json* list = Find(root, key);
  if (list == nullptr) {
    return names;
  }
  if (!list->is_array()) {
    Fail({"glTF"}, std::string(key) + " is not a list");
  }
  for (const Json& name : *list) {
    if (!name.is_string()) {
      Fail({"glTF"}, std::string(key) + " holds something that is not a text");
    }
    names.push_back(name.get<std::string>());
  }
  return names;
}

void IgnoreExtensions(const Json& root, Scene& scene) {
  for (const std::string& name : Names(root, "extensionsUsed")) {
    // Those of materials and instances are noted with the material and the node.
    const bool noted = name.starts_with("KHR_materials_") && name != "KHR_materials_variants";
    const bool unused = name == "KHR_materials_variants" || name == "KHR_animation_pointer";
    if (unused || (!noted && !IsHarmless(name) && name != "EXT_mesh_gpu_instancing")) {
      Ignore(scene, "extension " + Quoted(name), "kept as it is");
    }
  }
}

void IgnoreAnimations(const Json& root, Scene& scene) {
  const Json& animations = Objects(root, "animations", {"glTF"});
  for (std::size_t i = 0; i < animations.size(); ++i) {
    Ignore(scene, NameOf(root, "animations", i), "the scene is baked at rest");
  }
}

void IgnoreAttributes(const std::string& name, const Primitive& primitive, Scene& scene) {
  for (const auto& [attribute, accessor] : primitive.attributes) {
    const std::string feature = Quoted(attribute) + " of " + name;
    if (attribute == "COLOR_0") {
      Ignore(scene, feature, "the surface reflects baseColorFactor; the baked COLOR_0 takes its place");
    } else if (attribute == "_IRRADIANCE") {
      Ignore(scene, feature, "the baked _IRRADIANCE takes its place");
    } else if (!IsCarried(attribute) && attribute != "POSITION" && attribute != "NORMAL") {
      Ignore(scene, feature, "the node has no skin; not carried to the baked surface");
    } else if (attribute == "TEXCOORD_1") {
      Ignore(scene, feature, "the bake is at vertices and needs no second set; carried along");
    }
  }
}

void IgnoreMesh(const Json& root, const Layout& layout, std::size_t mesh, Scene& scene) {
  const std::vector<Primitive>& primitives = layout.meshes[mesh].primitives;
  for (std::size_t p = 0; p < primitives.size(); ++p) {
    const std::string name = NameOf(root, "meshes", mesh) + " primitive " + std::to_string(p);
    if (primitives[p].mode < Mode::kTriangles) {
      Ignore(scene, name, "points and lines neither block nor reflect light");
    } else if (!primitives[p].Find("POSITION")) {
      Ignore(scene, name, "has no positions");
    } else {
      IgnoreAttributes(name, primitives[p], scene);
    }
  }
}

}  // namespace

void CheckRequiredExtensions(const Json& root) {
  for (const std::string& name : Names(root, "extensionsRequired")) {
    if (!IsHarmless(name)) {
      Fail({"extensionsRequired"}, Quoted(name) + " is not supported");
    }
  }
}

void IgnoreFeatures(const Json& root, const Layout& layout, Scene& scene) {
  if (const Json& scenes = Objects(root, "scenes", {"glTF"}); scenes.size() > 1) {
    Ignore(scene, "other scenes than the default one", "left as they are");
  }
  const std::vector<Placed> placed = PlaceNodes(layout);
  IgnoreExtensions(root, scene);
  IgnoreAnimations(root, scene);
  std::set<std::size_t> noted;
  for (const Placed& place : placed) {
    const Node& node = layout.nodes[place.node];
    if (!node.mesh) {
      continue;
    }
    if (const std::string_view reason = StaysAsItIs(layout, node); !reason.empty()) {
      Ignore(scene, NameOf(root, "meshes", *node.mesh) + " of " + NameOf(root, "nodes", place.node),
             std::string(reason));
    } else if (noted.insert(*node.mesh).second) {
      IgnoreMesh(root, layout, *node.mesh, scene);
    }
  }
}

std::string NameOf(const Json& root, const char* list, std::size_t index) {
  const Json* name = Find(root.at(list)[index], "name");
  return std::string(Singular(list)) + ' ' +
         (name != nullptr && name->is_string() ? Quoted(name->get_ref<const std::string&>())
                                               : std::to_string(index));
}

}  // namespace radbake::gltf
