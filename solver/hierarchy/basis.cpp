#include "solver/hierarchy/basis.h"

#include <algorithm>
#include <cmath>

namespace radbake {
namespace {

/// 1, u, v, u², u·v, v²
std::array<double, 6> Monomials(double u, double v) {
  return {1, u, v, u * u, u * v, v * v};
}

double Dot(const std::array<double, 6>& a, const std::array<double, 6>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    sum += a[i] * b[i];
  }
  return sum;
}

}  // namespace

ElementBasis::ElementBasis(const Polygon& element, std::size_t count) : count_(count), more_{} {
  const Quadrature rule(element, ProductDegree(count));
  const Vec3& corner = element[0];
  Vec3 longest = Vec3::Zero();
  for (int k = 0; k < element.count; ++k) {
    const Vec3 edge = element[(k + 1) % element.count] - element[k];
    longest = edge.squaredNorm() > longest.squaredNorm() ? edge : longest;
  }
  origin_ = Vec3::Zero();
  for (const QuadraturePoint& point : rule.points()) {
    origin_ += point.weight * (point.x - corner);
  }
  origin_ += corner;
  const double length = longest.norm();
  if (count == 1 || !(length > 0)) {
    return;
  }
  // Cholesky's factor of the covariance in the axes along and across the longest edge.
  const Vec3 along = longest / length;
  const Vec3 across = element.normal.cross(along);
  double aa = 0;
  double ab = 0;
  double bb = 0;
  for (const QuadraturePoint& point : rule.points()) {
    const double a = along.dot(point.x - origin_);
    const double b = across.dot(point.x - origin_);
    aa += point.weight * a * a;
    ab += point.weight * a * b;
    bb += point.weight * b * b;
  }
  constexpr double kThin = 1e-12;  // aspects squared
  const double rest = aa > 0 ? bb - ab * ab / aa : 0;
  if (!(aa > 0)) {
    return;
  }
  u_ = along / std::sqrt(aa);
  if (!(rest > kThin * aa)) {
    return;
  }
  v_ = (across - ab / aa * along) / std::sqrt(rest);
  if (count <= BasisCount(BasisOrder::kLinear)) {
    return;
  }
  // Gram and Schmidt, twice for the digits: on the rule's points, where sums are integrals.
  for (std::size_t k = 0; k < more_.size(); ++k) {
    std::array<double, 6>& poly = more_[k];
    poly[3 + k] = 1;
    const auto remove = [&](const std::array<double, 6>& known) {
      double overlap = 0;
      for (const QuadraturePoint& point : rule.points()) {
        const auto m = Monomials(u_.dot(point.x - origin_), v_.dot(point.x - origin_));
        overlap += point.weight * Dot(poly, m) * Dot(known, m);
      }
      for (std::size_t i = 0; i < poly.size(); ++i) {
        poly[i] -= overlap * known[i];
      }
    };
    for (int pass = 0; pass < 2; ++pass) {
      remove({1});
      remove({0, 1});
      remove({0, 0, 1});
      for (std::size_t earlier = 0; earlier < k; ++earlier) {
        remove(more_[earlier]);
      }
    }
    double square = 0;
    for (const QuadraturePoint& point : rule.points()) {
      const auto m = Monomials(u_.dot(point.x - origin_), v_.dot(point.x - origin_));
      square += point.weight * Dot(poly, m) * Dot(poly, m);
    }
    for (double& coefficient : poly) {
      coefficient /= std::sqrt(square);
    }
  }
}

BasisValues ElementBasis::At(const Vec3& x) const {
  BasisValues values{1};
  if (count_ > 1) {
    values[1] = u_.dot(x - origin_);
    values[2] = v_.dot(x - origin_);
  }
  if (count_ > BasisCount(BasisOrder::kLinear)) {
    const auto m = Monomials(values[1], values[2]);
    for (std::size_t k = 0; k < more_.size(); ++k) {
      values[3 + k] = Dot(more_[k], m);
    }
  }
  return values;
}

void Basis::Extend(const Hierarchy& hierarchy) {
  if (count_ == 1) {
    return;
  }
  const std::size_t size = count_ * count_;
  elements_.reserve(hierarchy.size());
  two_scale_.reserve(size * hierarchy.size());
  two_scale_.resize(size * hierarchy.size());
  for (auto e = static_cast<Index>(elements_.size()); e < hierarchy.size(); ++e) {
    const Polygon shape = hierarchy.Shape(e);
    elements_.emplace_back(shape, count_);
    const Index parent = hierarchy[e].parent;
    if (parent == kNone) {
      continue;
    }
    const Quadrature rule(shape, ProductDegree(count_));
    for (const QuadraturePoint& point : rule.points()) {
      const BasisValues above = elements_[parent].At(point.x);
      const BasisValues here = elements_[e].At(point.x);
      for (std::size_t k = 0; k < count_; ++k) {
        for (std::size_t l = 0; l < count_; ++l) {
          two_scale_[size * e + count_ * k + l] += point.weight * above[k] * here[l];
        }
      }
    }
  }
}

void PushTo(const Basis& basis, Index child, ConstCoefficients parent, Coefficients coefficients) {
  const std::size_t count = basis.count();
  const std::span<const double> two_scale = basis.TwoScale(child);
  for (std::size_t k = 0; k < count; ++k) {
    for (std::size_t l = 0; l < count; ++l) {
      coefficients[l] += two_scale[count * k + l] * parent[k];
    }
  }
}

void PullFrom(const Basis& basis, Index child, double share, ConstCoefficients child_coefficients,
              Coefficients parent) {
  const std::size_t count = basis.count();
  const std::span<const double> two_scale = basis.TwoScale(child);
  for (std::size_t k = 0; k < count; ++k) {
    for (std::size_t l = 0; l < count; ++l) {
      parent[k] += share * two_scale[count * k + l] * child_coefficients[l];
    }
  }
}

void KeepPositive(const ElementBasis& basis, const Polygon& element, Coefficients coefficients) {
  Rgb lowest = coefficients[0];
  const auto look = [&](const Vec3& x) { lowest = lowest.min(Evaluate(coefficients, basis.At(x))); };
  for (int k = 0; k < element.count; ++k) {
    look(element[k]);
    look(0.5 * (element[k] + element[(k + 1) % element.count]));
  }
  look(element.Centroid());
  const Rgb mean = coefficients[0];
  const Rgb share = (lowest < 0).select(mean / (mean - lowest).max(1e-300), 1.0);
  for (Rgb& coefficient : coefficients.subspan(1)) {
    coefficient *= share;
  }
}

}  // namespace radbake
