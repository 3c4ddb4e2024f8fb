/// The light on the element hierarchy, in constants: one value a node, each the mean of its children by area.
#pragma once

#include <vector>

#include "solver/hierarchy/hierarchy.h"

namespace radbake {

/// The light on a cluster, of the patches below it. What leaves and what arrives depend on the direction.
struct ClusterLight {
  CosineSum aperture = CosineSum::Zero();         ///< Σ A·open·y(n) / Σ A: the part that receives
  RgbCosineSum radiosity = RgbCosineSum::Zero();  ///< Σ A·B·y(n) / Σ A, B that of the open parts
  /// Σ y(d)·E⊥ over the links into the cluster and those above, E⊥ the irradiance of what faces direction d:
  /// a patch below receives y(n) of it.
  RgbCosineSum irradiance = RgbCosineSum::Zero();
  Rgb mean = Rgb::Zero();  ///< of B by area
  double variation = 0;    ///< RMS deviation of luminous B from its mean
};

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

  std::vector<ClusterLight> clusters;  ///< by cluster
  std::vector<Rgb> punctual;           ///< intensities, by light: see PunctualLight

  /// What a receiver at `x` sees of any node: its radiosity in that direction, or the intensity.
  Rgb Shooting(const Hierarchy& hierarchy, Index node, const Vec3& x) const;

  /// The means of an inner node from what is right below it.
  void PullElement(const Hierarchy& hierarchy, Index element);
  void PullCluster(const Hierarchy& hierarchy, Index cluster);
  /// The share of each inner node that is open, from its leaves'.
  void PullOpen(const Hierarchy& hierarchy);

  /// Grows with the hierarchy: what is new starts with its parent's radiosity, a root with its emission;
  /// and open, until the solver has looked.
  void Extend(const Hierarchy& hierarchy);
};

}  // namespace radbake
