#include "solver/transport/coupling.h"

#include <algorithm>

namespace radbake {

BasisEnd::BasisEnd(const Hierarchy& hierarchy, const Basis& basis, Index element)
    : seen(hierarchy.Shape(element)),
      area(hierarchy[element].area),
      rule(seen.shape(), ProductDegree(basis.count())) {
  for (std::size_t q = 0; q < rule.points().size(); ++q) {
    values[q] = basis.At(element, rule.points()[q].x);
  }
}

BasisValues SeenFrom(const Vec3& x, const Vec3& n, const BasisEnd& shooter) {
  BasisValues sums{};
  for (std::size_t q = 0; q < shooter.rule.points().size(); ++q) {
    const QuadraturePoint& point = shooter.rule.points()[q];
    const Vec3 along = point.x - x;
    const double out = along.dot(n);
    const double in = -along.dot(shooter.seen.shape().normal);
    if (out > 0 && in > 0) {
      const double r2 = along.squaredNorm();
      const double kernel = point.weight * out * in / (r2 * r2);
      for (std::size_t k = 0; k < sums.size(); ++k) {
        sums[k] += kernel * shooter.values[q][k];
      }
    }
  }
  if (!(sums[0] > 0)) {
    return {1};
  }
  for (std::size_t k = 1; k < sums.size(); ++k) {
    sums[k] /= sums[0];
  }
  sums[0] = 1;
  return sums;
}

void CoupleShaped(const BasisEnd& receiver, const BasisEnd& shooter, std::size_t count,
                  std::span<float> couplings) {
  std::ranges::fill(couplings, 0.0F);
  const Vec3& normal = receiver.seen.shape().normal;
  const Vec3& normal_back = shooter.seen.shape().normal;
  const BasisValues back =
      MomentsOver(shooter, [&](const Vec3& y) { return receiver.seen.From(y, normal_back); });
  for (std::size_t j = 1; j < count; ++j) {
    couplings[j - 1] = static_cast<float>(shooter.area / receiver.area * back[j]);
  }
  for (std::size_t q = 0; q < receiver.rule.points().size(); ++q) {
    const QuadraturePoint& point = receiver.rule.points()[q];
    const double form_factor = point.weight * shooter.seen.From(point.x, normal);
    if (!(form_factor > 0)) {
      continue;
    }
    const BasisValues seen = SeenFrom(point.x, normal, shooter);
    for (std::size_t i = 1; i < count; ++i) {
      for (std::size_t j = 1; j < count; ++j) {
        couplings[(count - 1) * i + j - 1] +=
            static_cast<float>(form_factor * receiver.values[q][i] * seen[j]);
      }
    }
  }
}

BasisValues HiddenMoments(const Visibility& visibility, const BasisEnd& receiver, const BasisEnd& shooter,
                          const ElementBasis& basis, std::uint64_t key, int rays) {
  RaysBetween between(visibility, receiver.seen.shape(), shooter.seen.shape());
  if (between.empty()) {
    return {};
  }
  QuasiRandom<4> random(key);
  double all = 0;
  double open = 0;
  BasisValues all_moments{};
  BasisValues open_moments{};
  for (int k = 0; k < rays; ++k) {
    const RaysBetween::Ray ray = between.Cast(random);
    const BasisValues values = basis.At(ray.y);
    all += ray.weight;
    open += ray.open ? ray.weight : 0;
    for (std::size_t j = 1; j < values.size(); ++j) {
      all_moments[j] += ray.weight * values[j];
      open_moments[j] += ray.open ? ray.weight * values[j] : 0;
    }
  }
  BasisValues moments{};
  if (open > 0 && open < all) {
    for (std::size_t j = 1; j < moments.size(); ++j) {
      moments[j] = (open_moments[j] - open / all * all_moments[j]) / all;
    }
  }
  return moments;
}

}  // namespace radbake
