/// The uniform sky, as a lamp: a box around the scene that shines inwards, known by where it can be seen.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "solver/check/light_tree.h"
#include "solver/check/traced_scene.h"

namespace radbake {

/// The box is divided into cells, and rays from random places of the scene tell how much of each can be seen.
/// Cells are chosen by that, so that a room with a small window samples the window. How well it is known
/// decides the noise, never the mean. Thread-safe.
class Sky {
 public:
  /// Casts rays, on all threads of oneTBB's current arena, if the sky shines. Keeps no reference.
  Sky(const TracedScene& scene, const RayCaster& caster);

  /// A point of the box; it faces along the normal.
  struct Point {
    Vec3 point;
    Vec3 normal;
    double density;  ///< probability per area that Draw() at the place gives this point
  };
  /// Nothing where the sky is not worth a sample: it does not shine, or no ray found it.
  std::optional<Point> Draw(const Place& place, std::array<double, 2> sample) const;

  /// Where a ray that meets nothing leaves the box. The place must be one of the scene's surface.
  Point Exit(const Place& place, const Vec3& direction) const;

 private:
  struct Cell {
    Vec3 corner;
    Vec3 u;  // its edges
    Vec3 v;
    Vec3 normal;
  };
  static Cell CellOf(const Vec3& half, Index index);

  Vec3 half_;  // of the box's sizes; it is centred on the origin
  std::optional<LightTree> tree_;
};

}  // namespace radbake
