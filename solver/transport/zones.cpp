#include "solver/transport/zones.h"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <numeric>

#include "solver/transport/sampling.h"

namespace radbake {
namespace {

// From each patch. Few suffice, since whatever light goes one way goes the other.
constexpr std::size_t kRays = 8;

/// Disjoint sets with path halving (Tarjan 1975), each named by its smallest member.
class Sets {
 public:
  explicit Sets(Index count) : above_(count) { std::iota(above_.begin(), above_.end(), Index{0}); }
  Index Find(Index member) {
    while (above_[member] != member) {
      member = above_[member] = above_[above_[member]];
    }
    return member;
  }
  void Join(Index a, Index b) {
    a = Find(a);
    b = Find(b);
    above_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<Index> above_;
};

}  // namespace

std::vector<Index> FindZones(const Patches& patches, const Visibility& visibility) {
  const auto count = static_cast<Index>(patches.surface_patches);
  const bool sky = patches.patches.size() > patches.surface_patches;
  const Overlaps& overlaps = visibility.overlaps();
  std::vector<std::array<Index, kRays>> met(count);
  tbb::parallel_for(Index{0}, count, [&](Index p) {
    const Patch& patch = patches.patches[p];
    Polygon shape;
    shape.count = patch.corner_count;
    shape.normal = patch.normal;
    std::ranges::copy(patch.corner, shape.corner.begin());
    QuasiRandom<4> random(Hash(p));
    RayBatch batch(visibility);
    for (Index& at : met[p]) {
      const auto u = random.Next();
      const Vec3 x = PointOn(shape, u[0], u[1]);
      const Vec3 direction = CosineDirection(shape.normal, u[2], u[3]);
      at = kNone;
      if (!overlaps.empty() && overlaps.At(p, x) != p) {
        continue;
      }
      ++batch.rays;
      if (const auto hit = visibility.caster().Closest(x, direction); !hit) {
        at = sky ? count : kNone;
      } else {
        const Blocker& blocker = patches.blockers[hit->triangle];
        at = hit->front ? blocker.front : blocker.back;
        if (at != kNone && !overlaps.empty()) {
          at = overlaps.At(at, x + hit->distance * direction);
        }
      }
    }
  });
  Sets sets(count + 1);
  for (Index p = 0; p < count; ++p) {
    for (const Index at : met[p]) {
      if (at != kNone) {
        sets.Join(p, at);
      }
    }
  }
  std::vector<Index> size(count + 1);
  for (Index p = 0; p < count; ++p) {
    ++size[sets.Find(p)];
  }
  std::vector<Index> by_size(count + 1);
  std::iota(by_size.begin(), by_size.end(), Index{0});
  std::ranges::stable_sort(by_size, [&](Index a, Index b) { return size[a] > size[b]; });
  std::vector<Index> rank(count + 1);
  for (Index k = 0; k <= count; ++k) {
    rank[by_size[k]] = k;
  }
  std::vector<Index> zones(count);
  for (Index p = 0; p < count; ++p) {
    zones[p] = rank[sets.Find(p)];
  }
  return zones;
}

}  // namespace radbake
