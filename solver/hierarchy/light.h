/// The light on the element hierarchy, in constants: one value a node, each the mean of its children by area.
#pragma once

#include <vector>

#include "solver/hierarchy/hierarchy.h"

namespace radbake {

/// Indexed by element, in normalised units.
struct Light {
  std::vector<Rgb> radiosity;     ///< B = π·L_e + ρ·E
  std::vector<Rgb> irradiance;    ///< E, from the links of the element, its ancestors and its descendants
  std::vector<double> variation;  ///< RMS deviation of the leaves' luminous radiosity from the element's mean

  /// Grows with the hierarchy: what is new starts with its parent's radiosity, a root with its emission.
  void Extend(const Hierarchy& hierarchy);
};

}  // namespace radbake
