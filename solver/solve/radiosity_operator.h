/// The operator B ↦ π·L_e + ρ·K·B, without a matrix: pull up, gather along rows, reflect (Hanrahan 1991,
/// section 3.3: GatherRad and PushPullRad, on the leaves).
#pragma once

#include "solver/hierarchy/light.h"
#include "solver/solve/rows.h"

namespace radbake {

/// One RGB column a leaf, in the order of Rows::leaves(); normalised units.
using LeafValues = Eigen::Array3Xd;

/// What iterations need of it, plain sweeps and Krylov methods alike. The channels are three independent
/// systems; one application serves all. The same bits on any number of threads.
class RadiosityOperator {
 public:
  /// All must outlive the operator and stay as they are, but for Store().
  RadiosityOperator(const Hierarchy& hierarchy, const Rows& rows, const Light& light);

  Eigen::Index size() const { return emission_.cols(); }
  const LeafValues& emission() const { return emission_; }        ///< π·L_e
  const LeafValues& reflectance() const { return reflectance_; }  ///< ρ
  const LeafValues& from_lights() const { return from_lights_; }  ///< irradiance from lights without area
  const Eigen::ArrayXd& areas() const { return areas_; }          ///< 0 of the sky's
  double largest_reflectance() const { return reflectance_.size() > 0 ? reflectance_.maxCoeff() : 0; }

  /// The leaves' radiosities that `light` holds.
  LeafValues Radiosity(const Light& light) const;

  /// K·B, the irradiance of the leaves from the leaves: one application. Linear, for radiosities of any sign:
  /// Krylov methods apply it to differences. Pulls B up to means by area, and gathers
  /// along each leaf's row (its links and its ancestors', pushed down to it).
  LeafValues Gather(const LeafValues& radiosity) const;

  /// The norm over the leaves by area, of each channel.
  Rgb Norm(const LeafValues& values) const;

  /// Leaves the irradiance E, that from lights too, in `light`, and B = π·L_e + ρ·E; both, and the variation,
  /// pulled up.
  void Store(const LeafValues& irradiance, Light& light) const;

 private:
  const Hierarchy& hierarchy_;
  const Rows& rows_;
  const Light& light_;
  LeafValues emission_;
  LeafValues reflectance_;
  LeafValues from_lights_;
  Eigen::ArrayXd areas_;
};

}  // namespace radbake
