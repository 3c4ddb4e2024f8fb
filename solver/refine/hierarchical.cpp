#include "solver/refine/hierarchical.h"

#include <algorithm>
#include <numbers>

namespace radbake {
namespace {

/// The largest cosine between `normal` at `from` and the directions to the corners and centre of `to`.
double LargestCosine(const Vec3& from, const Vec3& normal, const Polygon& to) {
  double cosine = normal.dot((to.Centroid() - from).normalized());
  for (int k = 0; k < to.count; ++k) {
    const Vec3 along = to[k] - from;
    const double length = along.norm();
    if (length > 0) {
      cosine = std::max(cosine, normal.dot(along) / length);
    }
  }
  return std::max(0.0, cosine);
}

}  // namespace

double EstimateFormFactor(const Polygon& from, const Polygon& to, double to_area) {
  const Vec3 centre = from.Centroid();
  const double d2 = (to.Centroid() - centre).squaredNorm();
  return LargestCosine(centre, from.normal, to) * to_area / (std::numbers::pi * d2 + to_area);
}

Decision HierarchicalOracle::Judge(const Hierarchy& hierarchy, const Link& link) const {
  const Element& receiver = hierarchy[link.receiver];
  const Element& shooter = hierarchy[link.shooter];
  if (receiver.area < a_min_ && shooter.area < a_min_) {
    return Decision::kKeep;
  }
  const Polygon q = hierarchy.Shape(link.receiver);
  const Polygon p = hierarchy.Shape(link.shooter);
  if (EstimateFormFactor(q, p, shooter.area) < f_max_ && EstimateFormFactor(p, q, receiver.area) < f_max_) {
    return Decision::kKeep;
  }
  return receiver.area >= shooter.area ? Decision::kDivideReceiver : Decision::kDivideShooter;
}

}  // namespace radbake
