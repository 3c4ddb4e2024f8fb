/// Clusters: nodes above the patches, so that scenes of many polygons need few first links (Smits, Arvo,
/// Greenberg, A clustering algorithm for radiosity in complex environments, SIGGRAPH 1994; Sillion 1995).
#pragma once

#include <span>
#include <vector>

#include "solver/hierarchy/cosine_basis.h"
#include "solver/hierarchy/nodes.h"
#include "solver/scene/patches.h"

namespace radbake {

struct Cluster {
  Index parent = kNone;  ///< cluster
  std::uint32_t depth = 0;
  Vec3 centre = Vec3::Zero();
  double radius = 0;                     ///< of a sphere around everything below
  double area = 0;                       ///< of all patches below
  double reflectance = 0;                ///< the largest below, of any channel
  CosineSum extent = CosineSum::Zero();  ///< Σ A·y(n) / Σ A over the patches below: what is seen of them
  Index children_begin = 0;
  Index children_end = 0;
  Index patches_begin = 0;
  Index patches_end = 0;
};

/// A patch of a cluster, and its share of what leaves the cluster or arrives there.
struct PatchShare {
  Index patch = 0;
  float share = 0;
};

/// A tree of boxes over all surfaces' patches; a patch that is large for its box hangs directly below it.
/// Cluster 0 is the root, and every cluster comes after its parent. Immutable.
class Clusters {
 public:
  /// None: the patches stand alone.
  Clusters() = default;
  explicit Clusters(const Patches& patches);

  bool empty() const { return clusters_.empty(); }
  std::size_t size() const { return clusters_.size(); }
  const Cluster& operator[](Index cluster) const { return clusters_[cluster]; }

  /// Nodes: patches' roots and clusters.
  std::span<const Index> Children(Index cluster) const {
    const Cluster& c = clusters_[cluster];
    return std::span(children_).subspan(c.children_begin, c.children_end - c.children_begin);
  }
  std::span<const Index> PatchesBelow(Index cluster) const {
    const Cluster& c = clusters_[cluster];
    return std::span(order_).subspan(c.patches_begin, c.patches_end - c.patches_begin);
  }
  /// CosineBasis of a patch's normal.
  const CosineSum& BasisOf(Index patch) const { return basis_[patch]; }
  /// The cluster that a patch hangs below; kNone if there are no clusters.
  Index Above(Index patch) const { return clusters_.empty() ? kNone : above_[patch]; }
  /// Is the patch below the cluster?
  bool Holds(Index cluster, Index patch) const {
    Index above = above_[patch];
    while (above != kNone && above > cluster) {
      above = clusters_[above].parent;
    }
    return above == cluster;
  }
  /// The patch that holds the share `u` in [0, 1) of the cluster's area; `u` becomes the share of the patch.
  Index PatchAt(Index cluster, double& u) const;

 private:
  void Build(const Patches& patches, Index begin, Index end, Index parent);

  std::vector<Cluster> clusters_;
  std::vector<Index> children_;
  std::vector<Index> order_;        // patches, those below one cluster in a row
  std::vector<double> cumulative_;  // area of order_[0 … k]
  std::vector<Index> above_;        // by patch
  std::vector<CosineSum> basis_;    // by patch
};

}  // namespace radbake
