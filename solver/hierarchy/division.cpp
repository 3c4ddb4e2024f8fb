#include "solver/hierarchy/division.h"

namespace radbake {
namespace {

/// Positive to the left of the line from `a` to `b`: twice the area of the triangle that they are with `x`.
double Left(const Vec3& a, const Vec3& b, const Vec3& normal, const Vec3& x) {
  return normal.dot((b - a).cross(x - a));
}

}  // namespace

Index ChildAt(Division division, const std::array<Vec3, 4>& c, const Vec3& normal, const Vec3& x) {
  const auto between = [](const Vec3& a, const Vec3& b, double t) -> Vec3 { return a + t * (b - a); };
  switch (division) {
    case Division::kTriangle: {
      const double whole = Left(c[0], c[1], normal, c[2]);
      const double at_2 = Left(c[0], c[1], normal, x);
      const double at_0 = Left(c[1], c[2], normal, x);
      const double at_1 = whole - at_0 - at_2;
      return 2 * at_0 > whole ? 0 : 2 * at_1 > whole ? 1 : 2 * at_2 > whole ? 2 : 3;
    }
    case Division::kSquare: {
      const bool at_0_or_3 = Left(between(c[0], c[1], 0.5), between(c[3], c[2], 0.5), normal, x) > 0;
      const bool at_2_or_3 = Left(between(c[0], c[3], 0.5), between(c[1], c[2], 0.5), normal, x) > 0;
      return at_2_or_3 ? (at_0_or_3 ? 3 : 2) : (at_0_or_3 ? 0 : 1);
    }
    case Division::kAlong01: {
      const auto is_before = [&](double t) {
        return Left(between(c[0], c[1], t), between(c[3], c[2], t), normal, x) > 0;
      };
      return is_before(0.5) ? (is_before(0.25) ? 0 : 1) : (is_before(0.75) ? 2 : 3);
    }
    case Division::kAlong12:
      return ChildAt(Division::kAlong01, {c[1], c[2], c[3], c[0]}, normal, x);
  }
  return 0;
}

}  // namespace radbake
