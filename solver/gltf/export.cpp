#include "solver/gltf/export.h"

#include <algorithm>
#include <map>
#include <optional>
#include <set>

#include "solver/gltf/baked_primitive.h"
#include "solver/gltf/container.h"
#include "solver/gltf/images.h"
#include "solver/gltf/packer.h"

namespace radbake::gltf {
namespace {

constexpr const char* kUnlit = "KHR_materials_unlit";

bool IsBaked(const BakedSurface& surface) {
  return !surface.front.triangles.empty() || !surface.back.triangles.empty();
}

class Exporter {
 public:
  Exporter(const File& file, const Source& source, const Imported& imported, const BakedScene& baked)
      : file_(file),
        source_(source),
        imported_(imported),
        baked_(baked),
        root_(file.root),
        packer_(file, root_) {}

  std::string Run() {
    BakeMeshes();
    AssignMaterials();
    EmbedImages(root_, source_, [this](std::string_view bytes) { return packer_.AddView(bytes); });
    const std::string binary = packer_.Pack();
    return Join(root_, binary);
  }

 private:
  /// A baked primitive on its way to a material.
  struct Made {
    std::size_t mesh, primitive, surface;
  };

  /// Gives each node with a baked surface a mesh of its own. The first node of a mesh that no other node
  /// shows as it was takes the mesh's place.
  void BakeMeshes() {
    std::map<std::size_t, std::vector<std::size_t>> surfaces_of;  // node: surfaces
    for (std::size_t s = 0; s < baked_.surfaces.size(); ++s) {
      if (IsBaked(baked_.surfaces[s])) {
        surfaces_of[imported_.placements[s].node].push_back(s);
      }
    }
    std::set<std::size_t> taken;
    for (std::size_t i = 0; i < file_.layout.nodes.size(); ++i) {
      if (const Node& node = file_.layout.nodes[i]; node.mesh && surfaces_of.count(i) == 0) {
        taken.insert(*node.mesh);
      }
    }
    for (const auto& [node, surfaces] : surfaces_of) {
      const std::size_t original = *file_.layout.nodes[node].mesh;
      std::size_t target = original;
      if (!taken.insert(original).second) {
        target = root_.at("meshes").size();
        root_["meshes"].push_back(file_.root.at("meshes")[original]);
      }
      root_["nodes"][node]["mesh"] = target;
      BakeMesh(target, surfaces);
    }
  }

  void BakeMesh(std::size_t mesh, const std::vector<std::size_t>& surfaces) {
    Json& primitives = root_["meshes"][mesh]["primitives"];
    for (const std::size_t s : surfaces) {
      const Placement& placement = imported_.placements[s];
      const Material& material = imported_.scene.materials[imported_.scene.surfaces[s].material];
      const Json original = primitives[placement.primitive];
      const auto make = [&](const BakedMesh& side_mesh, Side side) {
        return MakePrimitive(original, placement, side_mesh, side, material, baked_.exposure, packer_);
      };
      std::size_t at = placement.primitive;
      if (!baked_.surfaces[s].front.triangles.empty()) {
        primitives[at] = make(baked_.surfaces[s].front, Side::kFront);
        made_.push_back({mesh, at, s});
        at = primitives.size();
      }
      if (!baked_.surfaces[s].back.triangles.empty()) {
        Json back = make(baked_.surfaces[s].back, Side::kBack);
        if (at == primitives.size()) {
          primitives.push_back(std::move(back));
        } else {
          primitives[at] = std::move(back);
        }
        made_.push_back({mesh, at, s});
      }
    }
  }

  /// Materials that a primitive still shows as they were. Those that were made have no material yet.
  std::set<std::size_t> MaterialsInUse() const {
    std::set<std::size_t> used;
    bool variants = false;
    const Json& meshes = root_.at("meshes");
    for (const Json& mesh : meshes) {
      for (const Json& primitive : Objects(mesh, "primitives", {"mesh"})) {
        if (const Json* material = Find(primitive, "material")) {
          used.insert(material->get<std::size_t>());
        }
        variants = variants || FindExtension(primitive, "KHR_materials_variants", {"mesh"}) != nullptr;
      }
    }
    const Json* materials = Find(root_, "materials");
    for (std::size_t i = 0; variants && materials != nullptr && i < materials->size(); ++i) {
      used.insert(i);  // a variant may choose any
    }
    return used;
  }

  void AssignMaterials() {
    const std::set<std::size_t> used = made_.empty() ? std::set<std::size_t>() : MaterialsInUse();
    std::map<std::optional<std::size_t>, std::size_t> unlit_of;
    for (const Made& made : made_) {
      const Placement& placement = imported_.placements[made.surface];
      const std::optional<std::size_t> original =
          file_.layout.meshes[placement.mesh].primitives[placement.primitive].material;
      const auto [found, is_new] = unlit_of.try_emplace(original, 0);
      if (is_new) {
        found->second = MakeMaterial(original, imported_.scene.surfaces[made.surface].material, used);
      }
      root_["meshes"][made.mesh]["primitives"][made.primitive]["material"] = found->second;
    }
    if (!made_.empty()) {
      Json& extensions = root_["extensionsUsed"];
      if (std::find(extensions.begin(), extensions.end(), kUnlit) == extensions.end()) {
        extensions.push_back(kUnlit);
      }
    }
  }

  std::size_t MakeMaterial(std::optional<std::size_t> original, Index scene_material,
                           const std::set<std::size_t>& used) {
    static const Json kPlain = {{"pbrMetallicRoughness", {{"metallicFactor", 0}}}};
    Json& materials = root_["materials"];
    Json unlit =
        MakeUnlit(original ? materials[*original] : kPlain, imported_.scene.materials[scene_material]);
    if (original && used.count(*original) == 0) {
      materials[*original] = std::move(unlit);
      return *original;
    }
    materials.push_back(std::move(unlit));
    return materials.size() - 1;
  }

  const File& file_;
  const Source& source_;
  const Imported& imported_;
  const BakedScene& baked_;
  Json root_;
  Packer packer_;
  std::vector<Made> made_;
};

}  // namespace

std::string Export(const File& file, const Source& source, const Imported& imported,
                   const BakedScene& baked) {
  return Exporter(file, source, imported, baked).Run();
}

}  // namespace radbake::gltf
