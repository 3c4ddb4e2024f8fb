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

/// The same between nodes that turn surfaces every way: a disc of `to`'s area that faces `from`.
double EstimateFormFactor(const Hierarchy& hierarchy, Index from, Index to) {
  const double d2 = (hierarchy.Centre(to) - hierarchy.Centre(from)).squaredNorm();
  const double area = hierarchy.Area(to);
  return area / (std::numbers::pi * d2 + area);
}

}  // namespace

double EstimateFormFactor(const Polygon& from, const Polygon& to, double to_area) {
  const Vec3 centre = from.Centroid();
  const Vec3 middle = to.Centroid();
  double radius2 = 0;
  for (int k = 0; k < to.count; ++k) {
    radius2 = std::max(radius2, (to[k] - middle).squaredNorm());
  }
  const bool is_long = radius2 > to_area;
  const double d2 = ((is_long ? NearestPoint(to, centre) : middle) - centre).squaredNorm();
  return LargestCosine(centre, from.normal, to) * to_area / (std::numbers::pi * d2 + to_area);
}

Decision HierarchicalOracle::Judge(const Hierarchy& hierarchy, const Link& link) const {
  const double receiver_area = hierarchy.Area(link.receiver);
  if (IsPunctual(link.shooter)) {
    // No area, no form factor: what it lights is divided down to the same size as beside a bright surface.
    return receiver_area < a_min_ ? Decision::kKeep : Decision::kDivideReceiver;
  }
  const double shooter_area = hierarchy.Area(link.shooter);
  if (receiver_area < a_min_ && shooter_area < a_min_) {
    return Decision::kKeep;
  }
  const bool elements = IsElement(link.receiver) && IsElement(link.shooter);
  const double there = elements ? EstimateFormFactor(hierarchy.Shape(link.receiver),
                                                     hierarchy.Shape(link.shooter), shooter_area)
                                : EstimateFormFactor(hierarchy, link.receiver, link.shooter);
  const double back = elements ? EstimateFormFactor(hierarchy.Shape(link.shooter),
                                                    hierarchy.Shape(link.receiver), receiver_area)
                               : EstimateFormFactor(hierarchy, link.shooter, link.receiver);
  // Where something hides a part of one from the other, the form factor is less certain than its size says.
  constexpr double kPartial = 0.25;
  const bool partial = link.visibility > 0 && link.visibility < 1;
  const bool sky = IsElement(link.shooter) && hierarchy.IsSky(link.shooter);
  const double most = partial && !sky ? kPartial * f_max_ : f_max_;
  if (there < most && back < most) {
    // From the sky's distance all of the scene is small, and what it is seen through is not: no form factor
    // says where its light ends.
    return sky && partial && receiver_area >= a_min_ ? Decision::kDivideReceiver : Decision::kKeep;
  }
  return IsAtLeast(receiver_area, shooter_area) ? Decision::kDivideReceiver : Decision::kDivideShooter;
}

}  // namespace radbake
