/// What a node has: polynomials over its surface, orthonormal, of degree 0, 1 or 2. With push and pull
/// between the levels they are multiwavelets (Gortler, Schröder, Cohen, Hanrahan, Wavelet radiosity, SIGGRAPH
/// 1993; Zatz, Galerkin radiosity, SIGGRAPH 1993).
#pragma once

#include <array>
#include <span>
#include <vector>

#include "solver/hierarchy/basis_order.h"
#include "solver/hierarchy/hierarchy.h"
#include "solver/scene/bytes.h"
#include "solver/scene/quadrature.h"

namespace radbake {

inline constexpr std::size_t kMostInBasis = BasisCount(BasisOrder::kQuadratic);

/// φ_0 … φ_{K−1} somewhere; what is beyond K is 0.
using BasisValues = std::array<double, kMostInBasis>;

/// The basis of one element: polynomials of the total degree in its plane with (1/A)·∫ φ_i·φ_j dA = δ_ij, so
/// φ_0 = 1, and the coefficient of φ_0 is the mean. In a plane any polynomial of the parent is one of the
/// child, whatever their shapes. An element too thin for it (1:10⁶) has fewer: the others are 0.
class ElementBasis {
 public:
  ElementBasis(const Polygon& element, std::size_t count);
  BasisValues At(const Vec3& x) const;
  const Vec3& centroid() const { return origin_; }

 private:
  std::size_t count_;
  Vec3 origin_;                                // the centroid
  Vec3 u_ = Vec3::Zero();                      // φ_1 = u·(x − origin)
  Vec3 v_ = Vec3::Zero();                      // φ_2
  std::array<std::array<double, 6>, 3> more_;  // φ_3 … in 1, φ_1, φ_2, φ_1², φ_1·φ_2, φ_2²
};

/// Of all elements of a hierarchy, and how each follows from its parent's.
class Basis {
 public:
  explicit Basis(BasisOrder order = BasisOrder::kConstant) : count_(BasisCount(order)) {}

  /// K
  std::size_t count() const { return count_; }
  /// Grows with the hierarchy. Constants are the same on every element: nothing is kept of them.
  void Extend(const Hierarchy& hierarchy);

  /// Only if K > 1.
  const ElementBasis& operator[](Index element) const { return elements_[element]; }
  BasisValues At(Index element, const Vec3& x) const {
    return count_ == 1 ? BasisValues{1} : elements_[element].At(x);
  }

  /// The two-scale relation φ_k = Σ_l H_kl·φ'_l, the parent's φ on its child's φ'; row by row. Only if K > 1
  /// and for children. It pushes down b'_l = Σ_k H_kl·b_k, and pulls up b_k = Σ_child (A'/A)·Σ_l H_kl·b'_l.
  std::span<const double> TwoScale(Index child) const {
    return std::span(two_scale_).subspan(count_ * count_ * child, count_ * count_);
  }

  /// Of memory.
  std::size_t Bytes() const { return BytesOf(elements_) + BytesOf(two_scale_); }

 private:
  std::size_t count_;
  std::vector<ElementBasis> elements_;
  std::vector<double> two_scale_;
};

/// K coefficients of a function in colour.
using Coefficients = std::span<Rgb>;
using ConstCoefficients = std::span<const Rgb>;

inline Rgb Evaluate(ConstCoefficients coefficients, const BasisValues& values) {
  Rgb sum = coefficients[0];
  for (std::size_t k = 1; k < coefficients.size(); ++k) {
    sum += values[k] * coefficients[k];
  }
  return sum;
}

/// Adds the parent's polynomial, on its child, to the child's.
void PushTo(const Basis& basis, Index child, ConstCoefficients parent, Coefficients coefficients);
/// Adds the child's part of the parent's coefficients: `share` of the parent's area.
void PullFrom(const Basis& basis, Index child, double share, ConstCoefficients child_coefficients,
              Coefficients parent);

/// Scales what is not the mean down until no channel is negative at the corners, at the edges' midpoints and
/// in the middle (Zhang and Shu 2010); the mean must not be negative.
void KeepPositive(const ElementBasis& basis, const Polygon& element, Coefficients coefficients);

}  // namespace radbake
