/// The light on the element hierarchy, in constants: one value a node, each the mean of its children by area.
#pragma once

#include <vector>

#include "solver/hierarchy/hierarchy.h"

namespace radbake {

/// Indexed by element, in normalised units.
struct Light {
  std::vector<Rgb> radiosity;   ///< B = π·L_e + ρ·E
  std::vector<Rgb> irradiance;  ///< E, from the links of the element, its ancestors and its descendants
  std::vector<double>
      variation;  ///< RMS deviation of the leaves' luminous radiosity from the mean of the open part
  /// Share of the element that any light can reach, in [0, 1]; what lies sealed under a box has none. An
  /// element's irradiance falls on its open part alone, and only that shoots.
  std::vector<double> open;

  /// Radiosity of the open part: what a receiver that sees the element sees.
  Rgb Shooting(Index element) const {
    return open[element] > 0 ? Rgb(radiosity[element] / open[element]) : Rgb::Zero();
  }

  /// Grows with the hierarchy: what is new starts with its parent's radiosity, a root with its emission;
  /// and open, until the solver has looked.
  void Extend(const Hierarchy& hierarchy);
};

}  // namespace radbake
