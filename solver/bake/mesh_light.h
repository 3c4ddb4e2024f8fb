/// What an output mesh says of the irradiance anywhere on it.
#pragma once

#include <span>
#include <vector>

#include "solver/hierarchy/hierarchy.h"
#include "solver/scene/bytes.h"

namespace radbake {

/// Linear over the fan of triangles around the centre of each element of a cut through the hierarchy. A copy:
/// the mesh may be gathered anew meanwhile, and divided further. Thread-safe.
class MeshLight {
 public:
  /// Irradiance by vertex and by element of `cut`, normalised; NaN where nobody sees it.
  MeshLight(const Hierarchy& hierarchy, std::span<const Index> cut, std::vector<Rgb> at_vertex,
            std::vector<Rgb> at_centre);

  /// At `y` on a patch; 0 where nobody sees it.
  Rgb At(Index patch, const Vec3& y) const;

  std::size_t Bytes() const { return BytesOf(at_vertex_) + BytesOf(at_centre_) + BytesOf(in_cut_); }

 private:
  Index ElementAt(Index patch, const Vec3& y) const;

  const Hierarchy& hierarchy_;
  std::vector<Rgb> at_vertex_;
  std::vector<Rgb> at_centre_;
  std::vector<Index> in_cut_;  // by element: its index there
};

}  // namespace radbake
