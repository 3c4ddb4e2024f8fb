#include "solver/scene/duplicates.h"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <tuple>

namespace radbake {
namespace {

std::uint64_t Mix(std::uint64_t hash, std::uint64_t bits) {
  hash = (hash ^ bits) * 0x9E3779B97F4A7C15U;
  return hash ^ (hash >> 29U);
}

std::uint64_t HashOf(const Vec3& point) {
  std::uint64_t hash = 0;
  for (const double coordinate : point) {
    hash = Mix(hash, std::bit_cast<std::uint64_t>(coordinate + 0.0));  // −0 is 0
  }
  return hash;
}

/// Of one hash: there are no more ways to lie and sides to face. Bounds the work on hashes made to collide.
constexpr std::size_t kMostKept = 8;

struct Entry {
  std::uint64_t hash;  // of the corners in any order
  Index surface;
  Index triangle;
};

/// How one triangle lies on another.
enum class Same { kNo, kWay, kTurned };

Same Compare(const std::array<Vec3, 3>& a, const std::array<Vec3, 3>& b) {
  for (std::size_t k = 0; k < 3; ++k) {
    if (a[0] == b[k]) {
      if (a[1] == b[(k + 1) % 3] && a[2] == b[(k + 2) % 3]) {
        return Same::kWay;
      }
      if (a[1] == b[(k + 2) % 3] && a[2] == b[(k + 1) % 3]) {
        return Same::kTurned;
      }
    }
  }
  return Same::kNo;
}

}  // namespace

std::size_t DropDuplicates(Scene& scene) {
  const auto corners = [&](const Entry& entry) {
    const Surface& surface = scene.surfaces[entry.surface];
    const Triangle& t = surface.triangles[entry.triangle];
    return std::array{surface.positions[t[0]], surface.positions[t[1]], surface.positions[t[2]]};
  };
  std::vector<Entry> entries;
  for (Index s = 0; s < scene.surfaces.size(); ++s) {
    for (Index t = 0; t < scene.surfaces[s].triangles.size(); ++t) {
      Entry entry{.hash = 0, .surface = s, .triangle = t};
      const auto [a, b, c] = corners(entry);
      if (a != b && b != c && c != a) {
        entry.hash = HashOf(a) + HashOf(b) + HashOf(c);
        entries.push_back(entry);
      }
    }
  }
  const auto key = [](const Entry& entry) { return std::tuple(entry.hash, entry.surface, entry.triangle); };
  std::ranges::sort(entries, {}, key);

  const auto covers = [&](const Entry& earlier, const Entry& later) {
    const Same same = Compare(corners(earlier), corners(later));
    const Material& over = scene.materials[scene.surfaces[earlier.surface].material];
    const Material& under = scene.materials[scene.surfaces[later.surface].material];
    if (same == Same::kNo || over.role != under.role) {
      return false;
    }
    return over.sides == Sides::kBoth || (same == Same::kWay && under.sides == Sides::kFront);
  };
  std::vector<Entry> dropped;
  for (std::size_t begin = 0; begin < entries.size();) {
    std::vector<Entry> kept{entries[begin]};
    std::size_t end = begin + 1;
    for (; end < entries.size() && entries[end].hash == entries[begin].hash; ++end) {
      if (std::ranges::any_of(kept, [&](const Entry& earlier) { return covers(earlier, entries[end]); })) {
        dropped.push_back(entries[end]);
      } else if (kept.size() < kMostKept) {
        kept.push_back(entries[end]);
      }
    }
    begin = end;
  }

  constexpr Triangle kDropped{kNone, kNone, kNone};
  for (const Entry& entry : dropped) {
    scene.surfaces[entry.surface].triangles[entry.triangle] = kDropped;
  }
  if (!dropped.empty()) {
    for (Surface& surface : scene.surfaces) {
      std::erase(surface.triangles, kDropped);
    }
  }
  return dropped.size();
}

}  // namespace radbake
