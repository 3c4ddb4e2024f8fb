#include "solver/gltf/import.h"

#include <algorithm>
#include <map>
#include <utility>

#include "solver/gltf/features.h"
#include "solver/gltf/lights.h"
#include "solver/gltf/materials.h"
#include "solver/scene/duplicates.h"

namespace radbake::gltf {
namespace {

/// The linear part with a largest coefficient of 1: products of three of them neither overflow nor vanish.
Eigen::Matrix3d Shape(const Eigen::Matrix4d& world) {
  const Eigen::Matrix3d linear = world.topLeftCorner<3, 3>();
  const double largest = linear.cwiseAbs().maxCoeff();
  return largest > 0 ? Eigen::Matrix3d(linear / largest) : linear;
}

/// The cofactor matrix is det · inverse transpose, and there for a flattening transform too.
Eigen::Matrix3d NormalTransform(const Eigen::Matrix4d& world) {
  const Eigen::Matrix3d shape = Shape(world);
  Eigen::Matrix3d cofactors;
  cofactors << shape.col(1).cross(shape.col(2)), shape.col(2).cross(shape.col(0)),
      shape.col(0).cross(shape.col(1));
  return Mirrors(world) ? Eigen::Matrix3d(-cofactors) : cofactors;
}

class Importer {
 public:
  Importer(const Json& root, const Layout& layout, const Limits& limits)
      : root_(root), layout_(layout), limits_(limits) {}

  Imported Run() {
    IgnoreFeatures(root_, layout_, imported_.scene);
    ImportLights(root_, layout_, imported_.scene);
    ForEachDrawing(layout_, limits_, [this](const Placed& placed, std::size_t p) { Add(placed, p); });
    if (imported_.scene.surfaces.empty()) {
      throw InputError("the scene has no triangles to bake");
    }
    if (flat_ > 0) {
      imported_.scene.warnings.push_back(std::to_string(flat_) + " of " + std::to_string(triangles_) +
                                         " triangles have no area");
    }
    if (const std::size_t duplicates = DropDuplicates(imported_.scene); duplicates > 0) {
      imported_.scene.warnings.push_back(std::to_string(duplicates) + " of " + std::to_string(triangles_) +
                                         " triangles are duplicates of others: left out");
    }
    return std::move(imported_);
  }

 private:
  void Add(const Placed& placed, std::size_t p) {
    const std::size_t m = *layout_.nodes[placed.node].mesh;
    std::shared_ptr<const Geometry>& geometry = geometries_[{m, p}];
    if (!geometry) {
      geometry = std::make_shared<const Geometry>(
          ReadGeometry(layout_, layout_.meshes[m].primitives[p], {"mesh", m, "primitive", p}));
    }
    Placement& placement =
        imported_.placements.emplace_back(Placement{placed.node, m, p, geometry, Mirrors(placed.world)});
    Surface& surface = imported_.scene.surfaces.emplace_back();
    surface.name = NameOf(root_, "nodes", placed.node) + " " + NameOf(root_, "meshes", m) + " primitive " +
                   std::to_string(p);
    surface.material = MaterialOf(layout_.meshes[m].primitives[p]);
    surface.attributes = geometry->attributes;
    surface.attribute_width = geometry->width;
    PlaceVertices(placed, placement, surface);
  }

  void PlaceVertices(const Placed& placed, const Placement& placement, Surface& surface) {
    const Geometry& geometry = *placement.geometry;
    surface.positions.reserve(geometry.positions.size());
    for (const Eigen::Vector3f& position : geometry.positions) {
      surface.positions.push_back(ToWorld(placed.world, position, placed.node));
    }
    surface.triangles = geometry.triangles;
    for (Triangle& triangle : surface.triangles) {
      if (placement.mirrored) {
        std::swap(triangle[1], triangle[2]);
      }
      const Vec3& origin = surface.positions[triangle[0]];
      const Vec3 edge = surface.positions[triangle[1]] - origin;
      const Vec3 other = surface.positions[triangle[2]] - origin;
      flat_ += edge.cross(other).stableNorm() > 0 ? 0U : 1U;
    }
    triangles_ += surface.triangles.size();
    const Eigen::Matrix3d to_world = NormalTransform(placed.world);
    surface.normals.reserve(geometry.normals.size());
    for (const Eigen::Vector3f& local : geometry.normals) {
      const Vec3 normal = to_world * local.cast<double>();
      // A transform that flattens the surface along its normal leaves no area, and none to light.
      surface.normals.push_back(normal.stableNorm() > 0 ? Vec3(normal.stableNormalized()) : Vec3::UnitZ());
    }
  }

  Index MaterialOf(const Primitive& primitive) {
    const auto [found, is_new] =
        materials_.try_emplace(primitive.material, static_cast<Index>(imported_.scene.materials.size()));
    if (is_new) {
      imported_.scene.materials.push_back(ImportMaterial(root_, primitive.material, imported_.scene));
    }
    return found->second;
  }

  const Json& root_;
  const Layout& layout_;
  const Limits& limits_;
  Imported imported_;
  std::map<std::pair<std::size_t, std::size_t>, std::shared_ptr<const Geometry>> geometries_;
  std::map<std::optional<std::size_t>, Index> materials_;
  std::size_t triangles_ = 0;
  std::size_t flat_ = 0;
};

}  // namespace

Imported Import(const Json& root, const Layout& layout, const Limits& limits) {
  return Importer(root, layout, limits).Run();
}

std::string_view StaysAsItIs(const Layout& layout, const Node& node) {
  if (node.skinned) {
    return "skinned: left as it is";
  }
  if (node.instanced) {
    return "instanced by EXT_mesh_gpu_instancing: left as it is";
  }
  if (node.mesh && layout.meshes[*node.mesh].morphs) {
    return "has morph targets: left as it is";
  }
  return {};
}

void ForEachDrawing(const Layout& layout, const Limits& limits,
                    const std::function<void(const Placed& placed, std::size_t primitive)>& visit) {
  std::size_t left = limits.triangles;
  for (const Placed& placed : PlaceNodes(layout)) {
    const Node& node = layout.nodes[placed.node];
    if (!node.mesh || !StaysAsItIs(layout, node).empty()) {
      continue;
    }
    const std::vector<Primitive>& primitives = layout.meshes[*node.mesh].primitives;
    for (std::size_t p = 0; p < primitives.size(); ++p) {
      const std::size_t triangles = primitives[p].Triangles(layout.accessors);
      // A primitive that draws nothing counts too: looking at it takes time.
      if (std::max<std::size_t>(triangles, 1) > left) {
        Fail({"node", placed.node}, "the scene has more than the limit of " +
                                        std::to_string(limits.triangles) + " triangles and primitives");
      }
      left -= std::max<std::size_t>(triangles, 1);
      if (triangles > 0 && primitives[p].Find("POSITION")) {
        visit(placed, p);
      }
    }
  }
}

Vec3 ToWorld(const Eigen::Matrix4d& world, const Eigen::Vector3f& position, std::size_t node) {
  constexpr double kFarthest = 1e30;
  Vec3 placed = world.topLeftCorner<3, 3>() * position.cast<double>() + world.topRightCorner<3, 1>();
  if (!(placed.cwiseAbs().maxCoeff() <= kFarthest)) {
    Fail({"node", node}, "a vertex is farther out than 1e30 m");
  }
  return placed;
}

bool Mirrors(const Eigen::Matrix4d& world) {
  return Shape(world).determinant() < 0;
}

}  // namespace radbake::gltf
