/// The scene as the path tracer sees it: triangles of unit size with their light, nothing of the solver's.
#pragma once

#include <array>
#include <vector>

#include "solver/scene/scene.h"
#include "solver/transport/ray_caster.h"

namespace radbake {

/// Moves and scales the world so that a scene's bounding box is centred on the origin and its longest side
/// is 1.
struct UnitBox {
  Vec3 centre = Vec3::Zero();
  double scale = 1;

  Vec3 operator()(const Vec3& world) const { return scale * (world - centre); }
};

/// What a ray meets. `emission` is relative to TracedScene::brightest.
struct Facet {
  Vec3 normal = Vec3::Zero();  ///< zero for a degenerate triangle, which no ray meets
  double area = 0;
  Rgb emission = Rgb::Zero();
  Rgb reflectance = Rgb::Zero();
  bool front = false;  ///< the front reflects and emits
  bool back = false;   ///< the back does
};

/// A point on a surface, and the normal of the side that is asked for.
struct Place {
  Vec3 point;
  Vec3 normal;
};

/// A point of a triangle, uniform by area for a point of the unit square.
Vec3 PointOf(const Corners& corners, std::array<double, 2> sample);

/// All triangles and lights of a scene; corners and facets have the same indices. Positions and lengths are
/// normalised, radiances and intensities relative to the brightest one, so that neither overflows when
/// squared.
struct TracedScene {
  /// Throws InputError if the scene has no triangle of positive area.
  explicit TracedScene(const Scene& scene);

  UnitBox normalization;
  /// The largest radiance of any channel in cd/m²: of what emits, of the sky, and of a white surface that a
  /// light without area shines on from the scene's size away; 0 if nothing emits.
  double brightest = 0;
  std::vector<Corners> corners;
  std::vector<Facet> facets;
  std::vector<PunctualLight> lights;
  Rgb environment = Rgb::Zero();
};

}  // namespace radbake
