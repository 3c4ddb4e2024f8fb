/// The scene as light sees it: surfaces in world space with diffuse materials. Nothing here knows glTF.
#pragma once

#include <limits>
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

/// A light without area (KHR_lights_punctual), as a node places it. It gives radiance of its own to nothing:
/// only what it lights is seen.
struct PunctualLight {
  enum class Kind { kPoint, kSpot, kDirectional };
  std::string name;
  Kind kind = Kind::kPoint;
  Vec3 position = Vec3::Zero();     ///< world space, metres; of no meaning for kDirectional
  Vec3 direction = -Vec3::UnitZ();  ///< unit, the way its light goes; of no meaning for kPoint
  Rgb intensity = Rgb::Zero();      ///< cd; of kDirectional the illuminance in lx on a surface that faces it
  double range = std::numeric_limits<double>::infinity();  ///< metres, above 0; kDirectional has none
  double inner_cosine = 1;  ///< kSpot: full light within this cone, none outside the outer one
  double outer_cosine = -1;

  /// Share of the intensity that goes to a point `along` metres away from the light: the cone of a spot and
  /// the window of a range, as KHR_lights_punctual defines them; 1/d² and cosines are not in it.
  double Attenuation(const Vec3& along) const;
};

/// A feature of the input that the bake does not use, and why: never dropped in silence.
struct Ignored {
  std::string feature;  ///< "punctual light 'lamp'", "baseColorTexture of material 'wood'"
  std::string reason;
};

struct Scene {
  std::vector<Material> materials;
  std::vector<Surface> surfaces;
  std::vector<PunctualLight> lights;
  Rgb environment = Rgb::Zero();  ///< radiance of a uniform sky in cd/m², not negative
  std::vector<Ignored> ignored;
  std::vector<std::string> warnings;
};

}  // namespace radbake
