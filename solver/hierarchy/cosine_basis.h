/// Sums of clamped cosines over directions, in nine numbers.
#pragma once

#include <cmath>

#include "solver/scene/types.h"

namespace radbake {

/// Σ_q w_q·max(0, n_q·ω), a function of direction, as Σ_q w_q·y(n_q): nine coefficients.
using CosineSum = Eigen::Array<float, 9, 1>;
/// The same with a colour for w.
using RgbCosineSum = Eigen::Array<float, 9, 3>;

/// y(ω) with y(n)·y(ω) ≈ max(0, n·ω): real spherical harmonics to second order, each weighted with the root
/// of the cosine's coefficient (Ramamoorthi and Hanrahan, An efficient representation for irradiance
/// environment maps, SIGGRAPH 2001). Off by at most 0.1, at grazing directions, and by 0.01 in the mean.
inline CosineSum CosineBasis(const Vec3& unit) {
  static const auto kFirst = static_cast<float>(std::sqrt(0.5));
  static const auto kSecond = static_cast<float>(std::sqrt(5.0 / 16.0));
  static const auto kRoot3 = static_cast<float>(std::sqrt(3.0));
  const Eigen::Vector3f v = unit.cast<float>();
  CosineSum y;
  y << 0.5F, kFirst * v.x(), kFirst * v.y(), kFirst * v.z(), kSecond * kRoot3 * v.x() * v.y(),
      kSecond * kRoot3 * v.y() * v.z(), kSecond * kRoot3 * v.z() * v.x(),
      kSecond * kRoot3 * 0.5F * (v.x() * v.x() - v.y() * v.y()), kSecond * 0.5F * (3 * v.z() * v.z() - 1);
  return y;
}

inline double Evaluate(const CosineSum& sum, const CosineSum& basis) {
  return static_cast<double>((sum * basis).sum());
}
inline Rgb Evaluate(const RgbCosineSum& sum, const CosineSum& basis) {
  return (sum.matrix().transpose() * basis.matrix()).array().cast<double>();
}

}  // namespace radbake
