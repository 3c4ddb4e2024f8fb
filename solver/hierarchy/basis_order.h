/// The degrees that a basis may have.
#pragma once

#include <cstddef>

namespace radbake {

/// Polynomials of degree 0, 1 or 2 over an element.
enum class BasisOrder { kConstant, kLinear, kQuadratic };

/// Those of two variables up to a degree: 1, 3 or 6.
constexpr std::size_t BasisCount(BasisOrder order) {
  return order == BasisOrder::kConstant ? 1 : order == BasisOrder::kLinear ? 3 : 6;
}

/// The degree of the product of two polynomials of a basis with so many.
constexpr int ProductDegree(std::size_t count) {
  return count == BasisCount(BasisOrder::kConstant) ? 0 : count == BasisCount(BasisOrder::kLinear) ? 2 : 4;
}

}  // namespace radbake
