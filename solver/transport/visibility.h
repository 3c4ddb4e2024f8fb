/// Visibility between elements: proved by a shaft where nothing can be in between, else sampled by rays.
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "solver/scene/overlaps.h"
#include "solver/scene/patches.h"
#include "solver/scene/polygon.h"
#include "solver/transport/ray_caster.h"
#include "solver/transport/sampling.h"
#include "solver/transport/shaft.h"

namespace radbake {

/// Rays cast so far, and the thread-seconds that they spent inside Embree (RayCaster::Seconds).
struct RayCount {
  std::uint64_t rays = 0;
  double seconds = 0;
};

/// Two independent samples of one visibility, which is in [0, 1]. A link that is refined or kept by the same
/// noise that it carries would carry too little: what is overestimated would be refined and measured again,
/// and what is underestimated would stay.
struct SampledVisibility {
  double carried = 0;  ///< for transport: in the mean right, so it may be above 1 by chance
  double judged = 0;   ///< for the oracle, in [0, 1]
};

/// Thread-safe. Results depend on the arguments alone.
class Visibility {
 public:
  explicit Visibility(const Patches& patches);

  /// Is it proved that nothing is between the two polygons, or on them? Costs no ray.
  bool Clear(const Polygon& a, const Polygon& b) const {
    return !MayBeCovered(a.patch) && !MayBeCovered(b.patch) && occluders_.Clear(a, b);
  }

  /// The share of rays between the parts of the two polygons that face one another that is not blocked, in
  /// [0, 1].
  SampledVisibility BetweenElements(const Polygon& a, const Polygon& b, double exchange_area,
                                    std::uint64_t key, int rays) const;

  /// The same from `x` to the polygon's part in front of the plane (x, n). Neighbouring polygons that take
  /// turns with one `random` stratify each other.
  double FromPoint(const Vec3& x, const Vec3& n, const Polygon& polygon, QuasiRandom<2>& random,
                   int rays) const;

  /// Does the place `y` on a polygon lie under another surface in the same plane (Overlaps), or see nothing
  /// but sides that give no light (it lies under a box, say)? Then no light gets there, and none leaves it.
  /// Adds the rays cast to `rays`: none where no blocker can be in between anything.
  bool IsSealed(const Vec3& y, const Polygon& polygon, std::uint64_t& rays) const;

  /// Is anything between two points, or on one of them? Each is on its patch; kNone: on none.
  bool Blocked(const Vec3& a, Index patch_a, const Vec3& b, Index patch_b) const {
    return Covered(a, patch_a) || Covered(b, patch_b) || caster_.Occluded(a, b);
  }

  /// The share of the polygon that is not sealed, in [0, 1]: sampled at `points` / 8 points, and at the rest
  /// only if those disagree.
  double OpenShare(const Polygon& polygon, std::uint64_t key, int points) const;

  const RayCaster& caster() const { return caster_; }
  /// Of the surfaces' patches.
  const Overlaps& overlaps() const { return overlaps_; }
  RayCount Counted() const;
  /// For whoever casts through caster() directly.
  void Count(std::uint64_t rays) const;

 private:
  bool MayBeCovered(Index patch) const {
    return !overlaps_.empty() && patch != kNone && overlaps_.AnyOver(patch);
  }
  bool Covered(const Vec3& x, Index patch) const {
    return !overlaps_.empty() && patch != kNone && overlaps_.At(patch, x) != patch;
  }
  bool SeesNothingLit(const Vec3& y, const Vec3& direction) const;

  struct Dead {
    bool front;
    bool back;
  };
  RayCaster caster_;
  Occluders occluders_;
  Overlaps overlaps_;
  std::vector<Dead> dead_;  // by blocker: the side gives no light
  bool any_dead_ = false;
  mutable std::atomic<std::uint64_t> rays_{0};
};

/// Counts one batch of rays.
class RayBatch {
 public:
  explicit RayBatch(const Visibility& visibility) : visibility_(visibility) {}
  ~RayBatch() { visibility_.Count(rays); }
  RayBatch(const RayBatch&) = delete;
  RayBatch& operator=(const RayBatch&) = delete;
  std::uint64_t rays = 0;

 private:
  const Visibility& visibility_;
};

/// Rays between the parts of two polygons that face one another, counted when it ends.
class RaysBetween {
 public:
  RaysBetween(const Visibility& visibility, const Polygon& a, const Polygon& b);
  RaysBetween(const RaysBetween&) = delete;
  RaysBetween& operator=(const RaysBetween&) = delete;

  /// Do they face one another nowhere? Then no ray may be cast.
  bool empty() const { return front_a_.count == 0 || front_b_.count == 0; }
  /// Of the parts that do.
  const Polygon& a() const { return front_a_; }
  const Polygon& b() const { return front_b_; }

  struct Ray {
    Vec3 y;         ///< its end on b
    double weight;  ///< cos·cos/r² over uniform pairs of points
    bool open;
  };
  Ray Cast(QuasiRandom<4>& random);

 private:
  const Visibility& visibility_;
  Polygon front_a_;
  Polygon front_b_;
  PointsOn on_a_;
  PointsOn on_b_;
  RayBatch batch_;
};

}  // namespace radbake
