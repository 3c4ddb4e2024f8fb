#include "solver/refine/adaptive.h"

#include <algorithm>
#include <cmath>

namespace radbake {
namespace {

// A sampled visibility of 0 or 1 that no shaft proves may still hide this much.
constexpr double kUnproved = 0.05;

// What a black surface keeps is part of the energy balance, though nothing is seen of how it is spread.
constexpr double kLeastPassedOn = 0.05;

double VisibilityUncertainty(const Link& link) {
  if (link.clear) {
    return 0;
  }
  const double v = link.judged;
  return std::max(kUnproved, 2 * std::sqrt(v * (1 - v)));
}

/// How unevenly the receiver sees the shooter, in [0, 1]: 0, and the mean radiosity is all that matters; 1,
/// and it may see just the darkest or the brightest part.
double UnevenView(const Hierarchy& hierarchy, const Link& link) {
  if (link.receiver == link.shooter) {
    return 1;
  }
  const double distance = (hierarchy.Centre(link.shooter) - hierarchy.Centre(link.receiver)).norm();
  const double kernel = link.judged * std::min(1.0, hierarchy.Radius(link.shooter) / distance);
  return std::max(kernel, VisibilityUncertainty(link));
}

double LargestReflectance(const Hierarchy& hierarchy, Index node) {
  return IsCluster(node) ? hierarchy.clusters()[node - kFirstCluster].reflectance
                         : hierarchy.PatchOf(node).reflectance.maxCoeff();
}

}  // namespace

AdaptiveOracle::Shot AdaptiveOracle::ShotOf(const Hierarchy& hierarchy, const Link& link) const {
  if (IsPunctual(link.shooter)) {
    return {Luminance(light_.punctual[link.shooter - kFirstPunctual]), 0};
  }
  if (IsCluster(link.shooter)) {
    const Index cluster = link.shooter - kFirstCluster;
    const Rgb seen = link.receiver == link.shooter
                         ? light_.cluster_radiosity[cluster].mean
                         : light_.Shooting(hierarchy, link.shooter, hierarchy.Centre(link.receiver));
    return {Luminance(seen), light_.cluster_variation[cluster]};
  }
  Index known = link.shooter;
  while (known >= light_.radiosity.size()) {
    known = hierarchy[known].parent;
  }
  // An element that has just been divided has not been solved yet: half of its parent's variation is a fair
  // guess.
  double variation = light_.variation[known];
  for (Index e = link.shooter; e != known; e = hierarchy[e].parent) {
    variation *= 0.5;
  }
  return {Luminance(light_.Shooting(known)), variation};
}

Decision AdaptiveOracle::Judge(const Hierarchy& hierarchy, const Link& link) const {
  const Shot shot = ShotOf(hierarchy, link);
  const double area = hierarchy.Area(link.receiver);
  const double passed_on = std::max(kLeastPassedOn, LargestReflectance(hierarchy, link.receiver));
  const double form_factor = link.judged_factor;
  const double by_kernel = shot.radiosity * area * link.variation * link.judged * passed_on;
  const double by_visibility = shot.radiosity * area * form_factor * VisibilityUncertainty(link) * passed_on;
  const double by_shooter = shot.variation > 0 ? shot.variation * form_factor * hierarchy.patches().area *
                                                     UnevenView(hierarchy, link)
                                               : 0;
  // The patches of a cluster share its light by how they are turned, not by which of them a shadow is on.
  // What goes wrong goes all the same way, from the lit side of a wall to the hidden one, and of direct light
  // it is most.
  constexpr double kDirect = 4;
  const bool sky = IsElement(link.shooter) && hierarchy.IsSky(link.shooter);
  if (IsCluster(link.receiver) && (sky || IsPunctual(link.shooter)) &&
      kDirect * (by_kernel + by_visibility) > w_min_) {
    return Decision::kDivideReceiver;
  }
  if (by_kernel + by_visibility + by_shooter <= w_min_) {
    return Decision::kKeep;
  }
  const double receiver_size = ComparableArea(hierarchy, link.receiver);
  const bool receiver_can = receiver_size > a_min_;
  if (IsPunctual(link.shooter)) {
    return receiver_can ? Decision::kDivideReceiver : Decision::kKeep;
  }
  const double shooter_size = ComparableArea(hierarchy, link.shooter);
  const bool shooter_can = shooter_size > a_min_;
  bool receiver_first = false;
  if (IsCluster(link.receiver) || IsCluster(link.shooter)) {
    // The kernel over a pair is as uneven as its larger end is wide.
    const double shooter_radius = hierarchy.Radius(link.shooter) / (sky ? kSkyDistance : 1);
    receiver_first =
        by_shooter <= by_kernel + by_visibility && hierarchy.Radius(link.receiver) >= shooter_radius;
  } else {
    const bool visibility_to_receiver = IsAtLeast(4 * receiver_size, shooter_size);
    receiver_first = by_kernel + (visibility_to_receiver ? by_visibility : 0) >=
                     by_shooter + (visibility_to_receiver ? 0 : by_visibility);
  }
  if (receiver_can && (receiver_first || !shooter_can)) {
    return Decision::kDivideReceiver;
  }
  return shooter_can ? Decision::kDivideShooter : Decision::kKeep;
}

}  // namespace radbake
