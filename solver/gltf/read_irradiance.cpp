#include <cmath>
#include <utility>

#include "solver/gltf/accessor.h"
#include "solver/gltf/document.h"
#include "solver/gltf/file.h"
#include "solver/gltf/geometry.h"
#include "solver/gltf/import.h"

namespace radbake::gltf {
namespace {

void Append(const Layout& layout, const Placed& placed, std::size_t p, BakedTriangles& baked) {
  const std::size_t mesh = *layout.nodes[placed.node].mesh;
  const Primitive& primitive = layout.meshes[mesh].primitives[p];
  const std::optional<std::size_t> irradiance = primitive.Find("_IRRADIANCE");
  if (!irradiance) {
    return;
  }
  const Place place{"mesh", mesh, "primitive", p};
  const Accessor& values = layout.accessors[*irradiance];
  if (values.rows != 3 || values.columns != 1 || values.component != Component::kFloat) {
    Fail(place, "_IRRADIANCE is not three floats a vertex");
  }
  const Accessor& positions = layout.accessors[*primitive.Find("POSITION")];
  std::vector<Triangle> triangles = ReadTriangles(layout, primitive, place);
  const auto first = static_cast<Index>(baked.positions.size());
  for (const Index vertex : CompactVertices(triangles)) {
    Eigen::Vector3f position;
    Eigen::Array3f lux;
    ReadElement(positions, vertex, position.data());
    ReadElement(values, vertex, lux.data());
    if (!lux.allFinite()) {
      Fail(place, "_IRRADIANCE of vertex " + std::to_string(vertex) + " is not a finite number");
    }
    baked.positions.push_back(ToWorld(placed.world, position, placed.node));
    baked.irradiance.emplace_back(lux.cast<double>());
  }
  for (Triangle& triangle : triangles) {
    if (Mirrors(placed.world)) {
      std::swap(triangle[1], triangle[2]);
    }
    baked.triangles.push_back({first + triangle[0], first + triangle[1], first + triangle[2]});
  }
}

}  // namespace

BakedTriangles ReadIrradiance(const Source& source) {
  const Limits limits;
  const File file(source, limits);
  BakedTriangles baked;
  ForEachDrawing(file.layout, limits,
                 [&](const Placed& placed, std::size_t p) { Append(file.layout, placed, p, baked); });
  if (baked.triangles.empty()) {
    throw InputError("nothing in it is baked: no primitive has _IRRADIANCE");
  }
  return baked;
}

}  // namespace radbake::gltf
