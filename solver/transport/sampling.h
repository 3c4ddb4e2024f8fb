/// Low-discrepancy sampling, keyed by what is sampled: the same numbers on any number of threads.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "solver/scene/polygon.h"

namespace radbake {

/// A hash of 64 bits to 64 bits (the finaliser of SplitMix64; Steele, Lea, Flood 2014).
inline std::uint64_t Hash(std::uint64_t x) {
  x += 0x9E3779B97F4A7C15U;
  x = (x ^ (x >> 30U)) * 0xBF58476D1CE4E5B9U;
  x = (x ^ (x >> 27U)) * 0x94D049BB133111EBU;
  return x ^ (x >> 31U);
}

/// The additive recurrence of Roberts (2018) in D dimensions, x_k = frac(offset + k·α) with α from the
/// generalised golden ratio, the offset (a Cranley-Patterson rotation) hashed from the key.
template <std::size_t D>
class QuasiRandom {
 public:
  explicit QuasiRandom(std::uint64_t key) {
    for (std::size_t d = 0; d < D; ++d) {
      key = Hash(key + d + 1);
      at_[d] = static_cast<double>(key >> 11U) * 0x1p-53;
    }
  }
  /// The next point, in [0, 1)^D.
  std::array<double, D> Next() {
    const std::array<double, D> point = at_;
    for (std::size_t d = 0; d < D; ++d) {
      at_[d] += Steps()[d];
      at_[d] -= std::floor(at_[d]);
    }
    return point;
  }

 private:
  static const std::array<double, D>& Steps() {
    static const std::array<double, D> kSteps = [] {
      double phi = 2;  // the root of φ^(D+1) = φ + 1
      for (int k = 0; k < 60; ++k) {
        phi = std::pow(1 + phi, 1.0 / (D + 1));
      }
      std::array<double, D> result{};
      double power = 1;
      for (double& step : result) {
        step = power /= phi;
      }
      return result;
    }();
    return kSteps;
  }

  std::array<double, D> at_;
};

/// The variance of the share of `n` points of QuasiRandom that lie on one side of edges, at most, in that of
/// a single point: n⁻¹ where edges are denser than the points, n⁻¹·⁵ where they are not.
inline double VarianceOfHits(int n) {
  constexpr double kEdges = 3;
  return std::min(1.0, kEdges / std::sqrt(n)) / n;
}

/// A unit vector around `axis` at an angle of this cosine, turned by the share `v` of a full circle.
Vec3 Around(const Vec3& axis, double cosine, double v);

/// A direction from a surface with unit `normal`, cosine-weighted if u and v are uniform in [0, 1).
inline Vec3 CosineDirection(const Vec3& normal, double u, double v) {
  return Around(normal, std::sqrt(1 - u), v);
}

/// Points of a convex polygon, uniform by area if u and v are uniform in [0, 1). The polygon must outlive it.
class PointsOn {
 public:
  explicit PointsOn(const Polygon& polygon);
  Vec3 operator()(double u, double v) const;

 private:
  const Polygon& polygon_;
  std::array<double, 5> area_{};  // of the fan's triangles, doubled
  double total_ = 0;
};

inline Vec3 PointOn(const Polygon& polygon, double u, double v) {
  return PointsOn(polygon)(u, v);
}

}  // namespace radbake
