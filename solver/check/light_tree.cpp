#include "solver/check/light_tree.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

namespace radbake {
namespace {

using Lamp = LightTree::Lamp;

// Nearer than this a lamp is not preferred any further: only coordinates' rounding is smaller.
constexpr double kNearest = 1e-6;

/// The cosine of an angle that is smaller by the one whose sine is given, but not below zero.
double CosineWithin(double cosine, double sine_less) {
  const double cosine_less = std::sqrt(std::max(0.0, 1 - sine_less * sine_less));
  if (cosine >= cosine_less) {
    return 1;
  }
  return cosine * cosine_less + std::sqrt(std::max(0.0, 1 - cosine * cosine)) * sine_less;
}

double Importance(const Lamp& lamp, const Place& place) {
  const Vec3 way = lamp.centre - place.point;
  const double distance = way.norm();
  const double nearest = std::max({distance, lamp.radius, kNearest});
  if (distance <= lamp.radius || distance == 0) {
    return lamp.weight / (nearest * nearest);
  }
  const double sine = lamp.radius / distance;
  const double receiving = CosineWithin(place.normal.dot(way) / distance, sine);
  const double leaving = CosineWithin(-lamp.axis.dot(way) / distance, sine);
  if (receiving <= 0 || leaving < lamp.cosine) {
    return 0;
  }
  return lamp.weight * receiving / (nearest * nearest);
}

/// The smallest cone around both.
void MergeCones(const Lamp& a, const Lamp& b, Lamp& both) {
  const Lamp& wide = a.cosine <= b.cosine ? a : b;
  const Lamp& narrow = a.cosine <= b.cosine ? b : a;
  both.axis = wide.axis;
  both.cosine = wide.cosine;
  const double wide_angle = std::acos(std::clamp(wide.cosine, -1.0, 1.0));
  const double narrow_angle = std::acos(std::clamp(narrow.cosine, -1.0, 1.0));
  const double between = std::acos(std::clamp(wide.axis.dot(narrow.axis), -1.0, 1.0));
  if (between + narrow_angle <= wide_angle) {
    return;
  }
  const double angle = (wide_angle + between + narrow_angle) / 2;
  const Vec3 across = wide.axis.cross(narrow.axis);
  if (angle >= std::numbers::pi || across.norm() == 0) {
    both.cosine = -1;
    return;
  }
  both.axis = Eigen::AngleAxisd(angle - wide_angle, across.normalized()) * wide.axis;
  both.cosine = std::cos(angle);
}

Lamp Merge(const Lamp& a, const Lamp& b) {
  Lamp both;
  both.weight = a.weight + b.weight;
  MergeCones(a, b, both);
  // The smallest sphere around both.
  const Vec3 between = b.centre - a.centre;
  const double distance = between.norm();
  if (distance + b.radius <= a.radius) {
    both.centre = a.centre;
    both.radius = a.radius;
  } else if (distance + a.radius <= b.radius) {
    both.centre = b.centre;
    both.radius = b.radius;
  } else {
    both.radius = (a.radius + distance + b.radius) / 2;
    both.centre = a.centre + between * ((both.radius - a.radius) / distance);
  }
  return both;
}

}  // namespace

LightTree::LightTree(std::span<const Lamp> lamps) : leaves_(lamps.size()) {
  if (lamps.empty()) {
    return;
  }
  nodes_.reserve(2 * lamps.size() - 1);
  std::vector<Index> order(lamps.size());
  std::iota(order.begin(), order.end(), Index{0});
  Build(lamps, order, 0);
}

void LightTree::Build(std::span<const Lamp> lamps, std::span<Index> order, Index parent) {
  const auto node = static_cast<Index>(nodes_.size());
  nodes_.push_back({.bounds = {}, .parent = parent});
  if (order.size() == 1) {
    nodes_[node].bounds = lamps[order[0]];
    nodes_[node].lamp = order[0];
    leaves_[order[0]] = node;
    return;
  }
  Eigen::AlignedBox3d box;
  for (const Index lamp : order) {
    box.extend(lamps[lamp].centre);
  }
  Eigen::Index axis = 0;
  box.sizes().maxCoeff(&axis);
  const std::size_t middle = order.size() / 2;
  std::ranges::nth_element(order, order.begin() + static_cast<std::ptrdiff_t>(middle), {},
                           [&](Index lamp) { return std::pair(lamps[lamp].centre[axis], lamp); });
  Build(lamps, order.first(middle), node);
  nodes_[node].second = static_cast<Index>(nodes_.size());
  Build(lamps, order.subspan(middle), node);
  nodes_[node].bounds = Merge(nodes_[node + 1].bounds, nodes_[nodes_[node].second].bounds);
}

std::optional<double> LightTree::OfFirst(Index node, const Place& place) const {
  const double first = Importance(nodes_[node + 1].bounds, place);
  const double second = Importance(nodes_[nodes_[node].second].bounds, place);
  if (first + second <= 0) {
    return std::nullopt;
  }
  return first / (first + second);
}

std::optional<LightTree::Choice> LightTree::Choose(const Place& place, double u) const {
  if (nodes_.empty() || Importance(nodes_[0].bounds, place) <= 0) {
    return std::nullopt;
  }
  Choice choice{.probability = 1, .rest = u};
  Index node = 0;
  while (nodes_[node].second != 0) {
    const std::optional<double> first = OfFirst(node, place);
    if (!first) {
      return std::nullopt;
    }
    if (choice.rest < *first) {
      choice.rest /= *first;
      choice.probability *= *first;
      ++node;
    } else {
      choice.rest = (choice.rest - *first) / (1 - *first);
      choice.probability *= 1 - *first;
      node = nodes_[node].second;
    }
    choice.rest = std::clamp(choice.rest, 0.0, std::nextafter(1.0, 0.0));
  }
  choice.lamp = nodes_[node].lamp;
  return choice;
}

double LightTree::Probability(Index lamp, const Place& place) const {
  if (Importance(nodes_[0].bounds, place) <= 0) {
    return 0;
  }
  double probability = 1;
  for (Index node = leaves_[lamp]; node != 0; node = nodes_[node].parent) {
    const Index parent = nodes_[node].parent;
    const std::optional<double> first = OfFirst(parent, place);
    if (!first) {
      return 0;
    }
    probability *= node == parent + 1 ? *first : 1 - *first;
  }
  return probability;
}

}  // namespace radbake
