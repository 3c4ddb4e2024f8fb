/// How an element divides into four.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "solver/scene/types.h"

namespace radbake {

enum class Division : std::uint8_t {
  kTriangle,  ///< at the edges' midpoints into three corner children (child k holds corner k) and the middle
              ///< one
  kSquare,    ///< bilinearly, child k holding corner k
  kAlong01,   ///< a quadrilateral that is long from corner 0 to 1, into four in a row
  kAlong12,   ///< one that is long from corner 1 to 2
};

/// The corners of the four children, from those of the parent and `midway(a, b)`. Corner 3 of triangles is
/// `none`.
template <typename Corner, typename Midway>
std::array<std::array<Corner, 4>, 4> CornersOfChildren(Division division, const std::array<Corner, 4>& c,
                                                       const Midway& midway, const Corner& none) {
  if (division == Division::kTriangle) {
    const Corner m01 = midway(c[0], c[1]);
    const Corner m12 = midway(c[1], c[2]);
    const Corner m20 = midway(c[2], c[0]);
    return {{{c[0], m01, m20, none}, {m01, c[1], m12, none}, {m20, m12, c[2], none}, {m12, m20, m01, none}}};
  }
  if (division == Division::kSquare) {
    const Corner m01 = midway(c[0], c[1]);
    const Corner m12 = midway(c[1], c[2]);
    const Corner m23 = midway(c[2], c[3]);
    const Corner m30 = midway(c[3], c[0]);
    const Corner middle = midway(m01, m23);
    return {{{c[0], m01, middle, m30},
             {m01, c[1], m12, middle},
             {middle, m12, c[2], m23},
             {m30, middle, m23, c[3]}}};
  }
  if (division == Division::kAlong12) {
    return CornersOfChildren(Division::kAlong01, {c[1], c[2], c[3], c[0]}, midway, none);
  }
  const Corner half = midway(c[0], c[1]);
  const Corner half_across = midway(c[3], c[2]);
  const std::array<Corner, 5> near = {c[0], midway(c[0], half), half, midway(half, c[1]), c[1]};
  const std::array<Corner, 5> far = {c[3], midway(c[3], half_across), half_across, midway(half_across, c[2]),
                                     c[2]};
  std::array<std::array<Corner, 4>, 4> children;
  for (std::size_t k = 0; k < 4; ++k) {
    children[k] = {near[k], near[k + 1], far[k + 1], far[k]};
  }
  return children;
}

/// Which of the four holds `x`, from the corners of the parent and the unit normal of its side; near its
/// outline `x` may be outside.
Index ChildAt(Division division, const std::array<Vec3, 4>& corner, const Vec3& normal, const Vec3& x);

}  // namespace radbake
