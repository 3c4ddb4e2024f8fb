/// The scene cut into patches: planar triangles, and convex planar quadrilaterals merged from neighbours.
///
/// Everything from here on lives in normalised space: the scene moved to its centre and scaled to unit size,
/// its emission scaled to unit power, all in double. A scene in micrometres bakes as one in light-years does.
#pragma once

#include <array>
#include <vector>

#include "solver/scene/scene.h"

namespace radbake {

/// Maps world space and photometric units to normalised ones and back.
struct Normalization {
  Vec3 centre = Vec3::Zero();  ///< world position of the normalised origin
  double scale = 1;            ///< normalised lengths per metre
  double radiance = 1;         ///< cd/m² per normalised radiance; irradiance in lx scales with it too
  Vec3 ToNormalized(const Vec3& world) const { return (world - centre) * scale; }
};

/// One side of a planar triangle or convex quadrilateral of one surface.
struct Patch {
  Index surface = 0;     ///< kNone: the sky
  bool back = false;     ///< the back side of a Sides::kBoth surface; corners run the other way round
  int corner_count = 3;  ///< 3 or 4
  std::array<Index, 4> source{};  ///< corners as vertices of the surface
  std::array<Vec3, 4> corner;     ///< normalised, counter-clockwise seen from the lit side
  std::array<Vec3, 4>
      shading_normal;  ///< unit; where two patches' agree at a shared corner, they are one smooth surface
  Vec3 normal;         ///< unit
  double area = 0;     ///< normalised
  Rgb emission = Rgb::Zero();  ///< π·L_e, normalised
  Rgb reflectance = Rgb::Zero();
};

/// A triangle of everything that blocks light, diffuse or not, for the ray caster.
struct Blocker {
  std::array<Vec3, 3> corner;  ///< normalised, counter-clockwise from the front
  Index front = kNone;         ///< the patch on its front, kNone: a blocker that is not lit
  Index back = kNone;          ///< the patch on its back, kNone: absorbs
};

/// Half the side of the cube that stands for a uniform sky: from here it is far, all but the same from
/// everywhere in the unit-sized scene.
inline constexpr double kSkyDistance = 32;

struct Patches {
  Normalization normalization;
  /// In the order of surfaces and triangles; then, under a sky, the six sides of a cube around the scene. Any
  /// closed convex body of one radiance looks the same from inside, so its distance does not matter.
  std::vector<Patch> patches;
  std::size_t surface_patches = 0;    ///< those before the sky's: what is lit
  std::vector<PunctualLight> lights;  ///< normalised: positions, ranges and intensities
  std::vector<Blocker> blockers;
  double area = 0;  ///< of all patches but the sky's, normalised
  double weld = 0;  ///< positions closer than this are one
};

/// Cuts the scene. Zero-area triangles are left out. Throws InputError if no surface can be lit, or nothing
/// gives light.
Patches CutIntoPatches(const Scene& scene);

}  // namespace radbake
