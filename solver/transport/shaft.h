/// Shaft culling: proof that nothing can be between two elements, so that no ray is cast there.
#pragma once

#include <span>
#include <vector>

#include "solver/scene/patches.h"
#include "solver/scene/polygon.h"

namespace radbake {

/// The space between two convex polygons, in the half-spaces in front of both: the box hull of Haines and
/// Wallace (Shaft culling for efficient ray-traced radiosity, 1991), cut by the polygons' own planes.
class Shaft {
 public:
  Shaft(const Polygon& a, const Polygon& b);

  /// May something inside the box be in the shaft? False is a proof.
  bool MayMeet(const Eigen::AlignedBox3d& box) const;
  /// May the triangle block a ray from one polygon to the other? False is a proof: it lies outside, or both
  /// polygons lie on one side of its plane. Touching does not block.
  bool MayBlock(const std::array<Vec3, 3>& triangle) const;

 private:
  std::array<Vec3, 14> ends_;  // the corners of both polygons
  std::size_t end_count_ = 0;
  Eigen::AlignedBox3d box_;
  std::array<Plane, 14> planes_;  // the shaft is behind each
  std::size_t plane_count_ = 0;
};

/// All blockers that can be between anything at all, in a tree of boxes. A blocker with the whole scene and
/// its lights on one side of its plane (the walls of a convex room) is not among them. Immutable;
/// thread-safe.
class Occluders {
 public:
  explicit Occluders(const Patches& patches);

  /// Is it proved that no blocker is between the two polygons?
  bool Clear(const Polygon& a, const Polygon& b) const;
  bool empty() const { return triangles_.empty(); }

 private:
  struct Node {
    Eigen::AlignedBox3d box;
    Index begin = 0;  // of triangles_, for a leaf
    Index end = 0;
    Index right = kNone;  // the left child follows its parent
  };
  void Build(Index begin, Index end);

  std::vector<std::array<Vec3, 3>> triangles_;
  std::vector<Node> nodes_;
};

}  // namespace radbake
