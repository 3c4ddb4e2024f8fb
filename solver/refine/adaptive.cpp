#include "solver/refine/adaptive.h"

#include <algorithm>
#include <cmath>

namespace radbake {
namespace {

// A sampled visibility of 0 or 1 that no shaft proves may still hide this much.
constexpr double kUnproved = 0.05;

double VisibilityUncertainty(const Link& link) {
  if (link.clear) {
    return 0;
  }
  const double v = link.judged;
  return std::max(kUnproved, 2 * std::sqrt(v * (1 - v)));
}

/// How unevenly the receiver sees the shooter, in [0, 1]: 0, and the mean radiosity is all that matters; 1,
/// and it may see just the darkest or the brightest part.
double UnevenView(const Link& link, const Polygon& receiver, const Polygon& shooter) {
  double extent = 0;
  const Vec3 centre = shooter.Centroid();
  for (int k = 0; k < shooter.count; ++k) {
    extent = std::max(extent, (shooter[k] - centre).norm());
  }
  const double kernel = link.judged * std::min(1.0, extent / (centre - receiver.Centroid()).norm());
  return std::max(kernel, VisibilityUncertainty(link));
}

}  // namespace

Decision AdaptiveOracle::Judge(const Hierarchy& hierarchy, const Link& link) const {
  const Element& receiver = hierarchy[link.receiver];
  const Element& shooter = hierarchy[link.shooter];
  Index known = link.shooter;
  while (known >= light_.radiosity.size()) {
    known = hierarchy[known].parent;
  }
  const double radiosity = Luminance(light_.Shooting(known));
  const double passed_on = hierarchy.PatchOf(link.receiver).reflectance.maxCoeff();
  const double form_factor = link.form_factor;

  const double by_kernel = radiosity * receiver.area * link.variation * link.judged * passed_on;
  const double by_visibility =
      radiosity * receiver.area * form_factor * VisibilityUncertainty(link) * passed_on;
  // An element that has just been divided has not been solved yet: half of its parent's variation is a fair
  // guess.
  double variation = light_.variation[known];
  for (Index e = link.shooter; e != known; e = hierarchy[e].parent) {
    variation *= 0.5;
  }
  const double by_shooter = variation * form_factor * hierarchy.patches().area *
                            UnevenView(link, hierarchy.Shape(link.receiver), hierarchy.Shape(link.shooter));

  if (by_kernel + by_visibility + by_shooter <= w_min_) {
    return Decision::kKeep;
  }
  const bool visibility_to_receiver = 4 * receiver.area >= shooter.area;
  const double for_receiver = by_kernel + (visibility_to_receiver ? by_visibility : 0);
  const double for_shooter = by_shooter + (visibility_to_receiver ? 0 : by_visibility);
  const bool receiver_can = receiver.area > a_min_;
  const bool shooter_can = shooter.area > a_min_;
  if (receiver_can && (for_receiver >= for_shooter || !shooter_can)) {
    return Decision::kDivideReceiver;
  }
  return shooter_can ? Decision::kDivideShooter : Decision::kKeep;
}

}  // namespace radbake
