#include "solver/bake/surroundings.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "solver/transport/sampling.h"

namespace radbake {
namespace {

/// Nothing, if it is the sky.
std::optional<Met> Meet(const Hierarchy& hierarchy, const Light& light, const Visibility& visibility,
                        const Vec3& x, const Vec3& direction) {
  const auto hit = visibility.caster().Closest(x, direction);
  if (!hit) {
    return std::nullopt;
  }
  const Blocker& blocker = hierarchy.patches().blockers[hit->triangle];
  Index patch = hit->front ? blocker.front : blocker.back;
  if (patch == kNone) {
    return Met{};
  }
  const Vec3 y = x + hit->distance * direction;
  if (visibility.overlaps().AnyOver(patch)) {
    patch = visibility.overlaps().At(patch, y);
  }
  return Met{.y = y, .leaf = SolverLeafAt(hierarchy, light, patch, y), .distance = hit->distance};
}

}  // namespace

double DepthInside(const Polygon& polygon, const Vec3& x) {
  double depth = std::numeric_limits<double>::infinity();
  for (int k = 0; k < polygon.count; ++k) {
    const Vec3 along = polygon[(k + 1) % polygon.count] - polygon[k];
    depth = std::min(depth, polygon.normal.cross(along).normalized().dot(x - polygon[k]));
  }
  return depth;
}

Index SolverLeafAt(const Hierarchy& hierarchy, const Light& light, Index element, const Vec3& x) {
  const auto solved = static_cast<Index>(light.irradiance.size());
  while (hierarchy[element].first_child < solved) {
    const Index first = hierarchy[element].first_child;
    double deepest = -std::numeric_limits<double>::infinity();
    for (Index child = first; child < first + 4; ++child) {
      const double depth = DepthInside(hierarchy.Shape(child), x);
      if (depth > deepest) {
        deepest = depth;
        element = child;
      }
    }
  }
  return element;
}

Estimate FromSurroundings(const Hierarchy& hierarchy, const Light& light, const Visibility& visibility,
                          const Vec3& x, const Vec3& n, double rays, std::uint64_t key,
                          const ReflectedThere& reflected) {
  // Strata about as wide as long.
  const bool is_sky = hierarchy.surface_root_count() < hierarchy.root_count();
  const Rgb sky =
      is_sky ? hierarchy.PatchOf(static_cast<Index>(hierarchy.surface_root_count())).emission : Rgb::Zero();
  const int rings = std::max(1, static_cast<int>(std::lround(std::sqrt(rays / 3))));
  const int around = std::max(1, static_cast<int>(std::lround(rays / rings)));
  Rgb sum = Rgb::Zero();
  double squares = 0;
  RayBatch batch(visibility);
  for (int i = 0; i < rings; ++i) {
    Rgb first = Rgb::Zero();
    Rgb last = Rgb::Zero();
    for (int j = 0; j < around; ++j) {
      key = Hash(key);
      const double u = (i + static_cast<double>(key >> 32U) * 0x1p-32) / rings;
      const double v = (j + static_cast<double>(key & 0xFFFF'FFFFU) * 0x1p-32) / around;
      ++batch.rays;
      auto met = Meet(hierarchy, light, visibility, x, CosineDirection(n, u, v));
      Rgb found = sky;
      if (met && met->leaf == kNone) {
        found = Rgb::Zero();
      } else if (met) {
        met->key = Hash(~key);
        found = reflected(*met);
      }
      sum += found;
      if (j == 0) {
        first = found;
      } else {
        squares += (found - last).square().sum();
      }
      last = found;
    }
    squares += (first - last).square().sum();
  }
  const double count = rings * around;
  return {sum / count, 0.5 * squares / (count * count)};
}

}  // namespace radbake
