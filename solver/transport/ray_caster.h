/// The one file that wraps Embree. Visibility and the checker's path tracer both cast their rays through it.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "solver/scene/types.h"

namespace radbake {

/// A triangle of the ray-casting geometry: three world-space corners, counter-clockwise from the front.
using Corners = std::array<Vec3, 3>;

/// Casts rays against a fixed set of triangles, which block from both sides. Thread-safe.
///
/// Robust where surfaces touch: a triangle is hit only if its plane, in double precision, properly separates
/// the two ends of the ray: both ends are further than kPlaneTolerance from it, on opposite sides. A ray that
/// starts or ends on a triangle, or in the plane of one, does not hit that triangle, whatever the rounding;
/// so no ray needs an offset. Neighbours whose shared corners are equal do not let a ray through between
/// them.
///
/// Not promised, since Embree works in single precision: which of two surfaces a few kPlaneTolerance apart
/// Closest() finds; what a ray does that passes within about kPlaneTolerance of a triangle's free edge; that
/// a ray aimed exactly at a corner where many triangles meet hits one of them (one in some hundred of these
/// slips through).
class RayCaster {
 public:
  /// What lies this near to a plane lies in it. Above the rounding of single-precision coordinates, which is
  /// what coincident surfaces of a glTF scene differ by; a tenth of a millimetre in a scene of a kilometre.
  static constexpr double kPlaneTolerance = 1e-7;

  /// Triangles should be about unit size around the origin. Degenerate ones are never hit.
  explicit RayCaster(std::span<const Corners> triangles);
  ~RayCaster();
  RayCaster(const RayCaster&) = delete;
  RayCaster& operator=(const RayCaster&) = delete;

  /// Is anything properly between a and b?
  bool Occluded(const Vec3& a, const Vec3& b) const;

  struct Hit {
    Index triangle;   ///< index into the constructor's span
    double distance;  ///< in lengths of `direction`
    bool front;       ///< the ray met the front side
  };
  /// The nearest triangle that a ray from `origin` along `direction` (any length but 0) meets.
  std::optional<Hit> Closest(const Vec3& origin, const Vec3& direction) const;

  /// Thread-seconds spent inside Embree, with its calls back, so far: extrapolated from one ray in 32 of each
  /// thread, so of use for thousands of rays and more.
  double Seconds() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace radbake
