/// Which of many lamps to sample from a place.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "solver/check/traced_scene.h"

namespace radbake {

/// A binary tree of lamps, each node with bounds on where its lamps are and which way they shine. Going down,
/// the child is drawn by weight · cos θ / d², with the cosine at its largest within the bounds, so that ten
/// thousand lamps cost a few steps and the near ones are chosen. Conty Estevez, Kulla: Importance sampling of
/// many lights with adaptive tree splitting, 2018. Thread-safe.
class LightTree {
 public:
  struct Lamp {
    Vec3 centre = Vec3::Zero();
    double radius = 0;  ///< the lamp is within it of the centre
    double weight = 0;  ///< above 0: the irradiance that it gives from far away, times the squared distance
    Vec3 axis = Vec3::UnitZ();
    double cosine = -1;  ///< it gives no light to where the angle from the axis has a smaller cosine
  };

  explicit LightTree(std::span<const Lamp> lamps);

  struct Choice {
    Index lamp = 0;
    double probability = 0;  ///< of this choice, above 0
    double rest = 0;         ///< what is left of `u`: uniform in [0, 1) given the choice
  };
  /// Nothing where no lamp can light the place. `u` in [0, 1).
  std::optional<Choice> Choose(const Place& place, double u) const;

  /// Of Choose() to choose the lamp.
  double Probability(Index lamp, const Place& place) const;

 private:
  struct Node {
    Lamp bounds;  // of all lamps below
    Index parent = 0;
    Index second = 0;  // child; the first one follows its parent; 0: a leaf
    Index lamp = 0;    // of a leaf
  };

  void Build(std::span<const Lamp> lamps, std::span<Index> order, Index parent);
  /// The probability of the first child, or nothing if neither can light the place.
  std::optional<double> OfFirst(Index node, const Place& place) const;

  std::vector<Node> nodes_;
  std::vector<Index> leaves_;  // by lamp
};

}  // namespace radbake
