/// What links bring to clusters, pushed down to the patches below.
#pragma once

#include <span>
#include <vector>

#include "solver/hierarchy/light.h"
#include "solver/refine/links.h"
#include "solver/solve/rows.h"
#include "solver/solve/shooters.h"

namespace radbake {

/// The light of a link into a cluster of few patches falls on those that its rays left from. Into a cluster
/// of many (or where that is far too much for those), a patch gets of what comes from outside by its
/// orientation (Smits, Arvo, Greenberg 1994, section 4; Sillion 1995), and as far as it is open to it; of
/// what the cluster's patches exchange, as far as they enclose it.
///
/// No patch sees more than all that is around it. By the chance of few rays single ones would get far more, a
/// small one a thousand times as much, and light that such patches hand to and fro would grow with each
/// reflection. So patches that get too much get less, and of each link's light the others more, in turn, as
/// Rows are balanced (Sinkhorn 1967). Where no patch of a cluster has room for what a link brings, it is
/// lost.
class ClusterPush {
 public:
  /// All must outlive it.
  ClusterPush(const Hierarchy& hierarchy, const Links& links, const Light& light);

  /// By patch, the mean over its area. The same bits on any number of threads.
  std::vector<Rgb> Push(const Shooters& shooters) const;

  /// Balances. `even`: as where everything shoots 1; `seen`: by patch, its irradiance from that, by whatever
  /// link.
  void Balance(const Shooters& even, std::span<const double> seen);

  /// Of memory.
  static std::size_t BytesNeeded(const Hierarchy& hierarchy, const Links& links);

 private:
  /// Of what falls on a cluster of many patches.
  struct Incident {
    RgbCosineSum outside = RgbCosineSum::Zero();  // Σ y(d)·E⊥ over links, E⊥ of what faces direction d
    Rgb inside = Rgb::Zero();
  };
  Incident CollectOn(Index cluster, const Shooters& shooters) const;
  std::size_t IndexOf(const Link& link) const {
    return static_cast<std::size_t>(&link - links_.all().data());
  }
  /// So that each link brings its mean to patches that take `scale_` of what would fall on them.
  void ScaleLinks();

  const Hierarchy& hierarchy_;
  const Links& links_;
  const Light& light_;
  std::vector<double> scale_;  // by patch
  // By patch, what falls on it of links into clusters of few patches.
  std::vector<std::size_t> begin_;
  std::vector<Gathered> entries_;
  std::vector<char> by_orientation_;  // by link into a cluster: it falls on all patches as on many
  // By cluster, as Light has them, with that scale.
  std::vector<CosineSum> aperture_;
  std::vector<double> enclosed_;
};

}  // namespace radbake
