/// The scene as light sees it: surfaces in world space with diffuse materials. Nothing here knows glTF.
#pragma once

#include <string>
#include <vector>

#include "solver/scene/types.h"

namespace radbake {

/// Which sides of a surface reflect and emit. Either kind blocks light from both sides.
enum class Sides { kFront, kBoth };

/// What a surface does to light. kBlocker: already unlit in the input: blocks, gives nothing, is not baked.
enum class Role { kDiffuse, kBlocker };

struct Material {
  std::string name;
  Rgb reflectance = Rgb::Zero();  ///< in [0, 1): the importer clamps and warns
  Rgb emission = Rgb::Zero();     ///< radiance L_e in cd/m², finite, not negative
  Sides sides = Sides::kFront;
  Role role = Role::kDiffuse;
};

/// One glTF primitive as one node places it. Vertices are welded: no two have the same position, normal and
/// attributes, bit by bit.
struct Surface {
  std::string name;  ///< for messages: node, mesh and primitive
  Index material = 0;
  std::vector<Vec3> positions;      ///< world space, metres
  std::vector<Vec3> normals;        ///< world space, unit length, one a vertex; or empty: flat shading
  std::vector<Triangle> triangles;  ///< counter-clockwise from the front, in world space (mirroring undone)
  /// Everything else that is interpolated over the surface (texture coordinates, colours, …),
  /// `attribute_width` floats a vertex; triangles merge into a patch only where these are affine over it.
  std::vector<float> attributes;
  std::size_t attribute_width = 0;
};

/// A feature of the input that the bake does not use, and why: never dropped in silence.
struct Ignored {
  std::string feature;  ///< "punctual light 'lamp'", "baseColorTexture of material 'wood'"
  std::string reason;
};

struct Scene {
  std::vector<Material> materials;
  std::vector<Surface> surfaces;
  std::vector<Ignored> ignored;
  std::vector<std::string> warnings;
};

}  // namespace radbake
