#include "solver/bake/surroundings.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "solver/transport/sampling.h"

namespace radbake {
namespace {

/// Nothing, if it is the sky.
std::optional<Met> Meet(const Hierarchy& hierarchy, const Visibility& visibility, const Vec3& x,
                        const Vec3& direction) {
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
  return Met{.y = y, .patch = patch};
}

/// Sum of the variances of what is found in the strata of a ring, from how each differs from its neighbours
/// on both sides: what the light changes by around the ring is no variance of a stratum's.
double Roughness(std::span<const Rgb> ring) {
  const std::size_t count = ring.size();
  double squares = 0;
  if (count < 3) {
    for (const Rgb& found : ring) {
      squares += (found - ring[0]).square().sum();
    }
    return squares;
  }
  for (std::size_t j = 0; j < count; ++j) {
    squares += (ring[(j + count - 1) % count] - 2 * ring[j] + ring[(j + 1) % count]).square().sum() / 6;
  }
  return squares;
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
    element = hierarchy.ChildAt(element, x);
  }
  return element;
}

Estimate FromSurroundings(const Hierarchy& hierarchy, const Visibility& visibility, const Vec3& x,
                          const Vec3& n, double rays, std::uint64_t key, const ReflectedThere& reflected) {
  // Strata about as wide as long.
  const bool is_sky = hierarchy.surface_root_count() < hierarchy.root_count();
  const Rgb sky =
      is_sky ? hierarchy.PatchOf(static_cast<Index>(hierarchy.surface_root_count())).emission : Rgb::Zero();
  const int rings = std::max(1, static_cast<int>(std::lround(std::sqrt(rays / 3))));
  const int around = std::max(1, static_cast<int>(std::lround(rays / rings)));
  Rgb sum = Rgb::Zero();
  double squares = 0;
  RayBatch batch(visibility);
  std::vector<Rgb> ring(static_cast<std::size_t>(around));
  for (int i = 0; i < rings; ++i) {
    for (int j = 0; j < around; ++j) {
      key = Hash(key);
      const double u = (i + static_cast<double>(key >> 32U) * 0x1p-32) / rings;
      const double v = (j + static_cast<double>(key & 0xFFFF'FFFFU) * 0x1p-32) / around;
      ++batch.rays;
      Rgb& found = ring[static_cast<std::size_t>(j)];
      found = sky;
      if (const auto met = Meet(hierarchy, visibility, x, CosineDirection(n, u, v))) {
        found = met->patch == kNone ? Rgb::Zero() : reflected(*met);
      }
      sum += found;
    }
    squares += Roughness(ring);
  }
  const double count = rings * around;
  return {sum / count, squares / (count * count)};
}

}  // namespace radbake
