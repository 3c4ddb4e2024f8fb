/// The operator B ↦ π·L_e + ρ·K·B, without a matrix: pull up, gather along rows, reflect (Hanrahan 1991,
/// section 3.3: GatherRad and PushPullRad, on the leaves).
#pragma once

#include "solver/hierarchy/light.h"
#include "solver/solve/cluster_push.h"
#include "solver/solve/couplings.h"
#include "solver/solve/rows.h"
#include "solver/solve/shooters.h"
#include "solver/solve/solution.h"

namespace radbake {

/// One RGB column a coefficient, K a leaf, in the order of Rows::leaves(); normalised units.
using LeafValues = Eigen::Array3Xd;

/// What iterations need of it, plain sweeps and Krylov methods alike. The channels are three independent
/// systems; one application serves all. The same bits on any number of threads.
class RadiosityOperator {
 public:
  /// What the rows call leaves may in constants have elements below it: they have the same radiosity then.
  /// All must outlive the operator and stay as they are, but for Store().
  RadiosityOperator(const Hierarchy& hierarchy, const Links& links, const Rows& rows,
                    const Couplings& couplings, const Light& light);

  Eigen::Index size() const { return emission_.cols(); }
  /// π·L_e + ρ·(irradiance from the sky and from lights without area)
  const LeafValues& emission() const { return emission_; }
  const LeafValues& reflectance() const { return reflectance_; }  ///< ρ
  const Eigen::ArrayXd& areas() const { return areas_; }          ///< by column
  double largest_reflectance() const { return reflectance_.size() > 0 ? reflectance_.maxCoeff() : 0; }

  /// The leaves' radiosities that `light` holds.
  LeafValues Radiosity(const Light& light) const;

  /// K·B, the irradiance of the leaves from one another: one application. Linear. Pulls B up to means by area
  /// and to clusters, gathers along each leaf's row (its links and its ancestors', pushed down to it), and
  /// adds what clusters gathered, pushed down to the patches by their orientation. In a higher basis, B is
  /// pulled up as polynomials, and what links bring by their couplings is pushed down as such.
  LeafValues Gather(const LeafValues& radiosity) const;

  /// For each leaf (all its columns) the mean |value| over its patch, or over the cluster that the patch
  /// hangs below: what an error there is measured by, so that a dim room beside a bright one is solved as
  /// exactly. (What clusters push down to a single patch may be no more than their basis' error.)
  LeafValues LocalMeans(const LeafValues& values) const;
  /// The RMS by area of values / measures where there is a measure, of each channel.
  Rgb RelativeRms(const LeafValues& values, const LeafValues& measures) const;

  /// Does `light` keep more power than there is, in any channel? Rays make form factors uncertain. Where a
  /// cavity's sum to more than one over its reflectance, light grows there from one reflection to the next.
  bool Grows(const Light& light) const;
  /// From now on the form factors of such leaves sum to 1, so that nothing grows.
  void Bound();

  /// Leaves E = `irradiance` and that from the sky and the lights in `light`, and B = π·L_e + ρ·E; both, and
  /// the variation, pulled up. What clusters push down may fall below 0 by their basis' error, and is cut;
  /// polynomials that do so are flattened.
  void Store(const LeafValues& irradiance, Light& light) const;

  /// What one will hold, and need beside it for an application. `count`: K.
  static SolveBytes BytesNeeded(const Hierarchy& hierarchy, const Links& links, const Rows& rows,
                                std::size_t count);

 private:
  Shooters Surfaces(const LeafValues& radiosity) const;
  Shooters Distant() const;
  /// By link, what its receiver sees of a shooting cluster: the patches that the link's rays met, which know
  /// what is turned away and what hides what.
  std::vector<Rgb> ShootingOfClusters(const std::vector<Rgb>& elements) const;
  /// Radiosity 1 of all that is open.
  LeafValues EvenLight() const;
  /// So that no patch gets more from clusters than it can see.
  void BalancePush();
  LeafValues Collect(const Shooters& shooters) const;
  void StoreShape(std::size_t k, const LeafValues& irradiance, Light& light) const;
  /// By element, K each: the polynomials that couplings bring, the ancestors' too.
  std::vector<Rgb> CollectShaped(const Shooters& shooters) const;

  Index PatchOf(Eigen::Index column) const {
    return hierarchy_[rows_.leaves()[static_cast<std::size_t>(column) / count_]].patch;
  }
  bool IsMean(Eigen::Index column) const { return static_cast<std::size_t>(column) % count_ == 0; }
  /// Of the mean of leaves()[k].
  Eigen::Index Column(std::size_t k) const { return static_cast<Eigen::Index>(count_ * k); }

  const Hierarchy& hierarchy_;
  const Links& links_;
  const Rows& rows_;
  const Couplings& couplings_;
  const Light& light_;
  std::size_t count_;  // K
  LeafValues emission_;
  LeafValues distant_;  // irradiance from the sky and from lights without area
  LeafValues reflectance_;
  Eigen::ArrayXd areas_;
  ClusterPush push_;
  Eigen::ArrayXd bounds_;  // by column, what its form factors are multiplied by
};

}  // namespace radbake
