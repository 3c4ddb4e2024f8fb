/// The rows of the transport operator K, one for each leaf: what it gathers, and from whom.
#pragma once

#include <span>
#include <vector>

#include "solver/hierarchy/light.h"
#include "solver/refine/links.h"

namespace radbake {

/// E_leaf = Σ weight · B_shooter, over the links into the leaf and into its ancestors.
struct Gathered {
  Index shooter = 0;  ///< see GatheredFrom
  float weight = 0;   ///< form factor from the leaf (of a light: its kernel) · visibility
};

/// Who shoots along a link: the shooter; where that is a cluster, ClusterNode() of the link's place in
/// Links::all(), for each receiver sees others of its patches.
inline Index GatheredFrom(const Links& links, const Link& link) {
  return IsCluster(link.shooter) ? ClusterNode(static_cast<Index>(&link - links.all().data())) : link.shooter;
}

/// A link into an ancestor holds the mean form factor over it, and a leaf may be far from that mean: where
/// patches touch, by so much that rows made of means sum to anything from 0.6 to 1.5, and the sum over all
/// bounces need not even converge. So a leaf has the form factors at its centroid for its ancestors' links,
/// beside the means of its own, scaled so that
/// - a row sums to what its leaf's centroid sees: to 1 in a closed convex room, whatever the oracle kept;
/// - a link brings its leaves together its mean, as near as the rows allow: energy is kept.
/// Both at once is matrix balancing (Sinkhorn 1967); rows, links, and rows again bring both below 0.5 % in
/// rooms of any shape.
///
/// In a higher basis the centroid's place is taken by the points of a quadrature in the leaf, whose mean is
/// what it sees; and beside each weight stand its moments, those of the form factor with φ_1 … over the leaf.
/// They are not scaled: at each point all that is seen sums to 1 in a closed room, so in the sum moments
/// cancel.
class Rows {
 public:
  /// Of the leaves of `hierarchy` that are on surfaces, in the basis of `light`, which says too which parts
  /// of elements are open. The same bits on any number of threads.
  Rows(const Hierarchy& hierarchy, const Links& links, const Light& light);

  /// Of the given nodes, which have no links of their own, in constants: the means by area of their leaves'
  /// rows,
  ///   F_ij = Σ_q F_qj·A_q / A_i.
  Rows(const Hierarchy& hierarchy, const Rows& of_leaves, const std::vector<Index>& nodes);

  std::span<const Index> leaves() const { return leaves_; }
  /// The row of leaves()[k].
  std::span<const Gathered> operator[](std::size_t k) const {
    return std::span(entries_).subspan(begin_[k], begin_[k + 1] - begin_[k]);
  }
  /// K − 1 for each of its entries.
  std::span<const float> Moments(std::size_t k) const {
    return std::span(moments_).subspan(shapes_ * begin_[k], shapes_ * (begin_[k + 1] - begin_[k]));
  }

  /// What the first of them will hold.
  static std::size_t BytesNeeded(const Hierarchy& hierarchy, const Links& links, const Light& light);
  /// Of memory.
  std::size_t Bytes() const {
    return BytesOf(leaves_) + BytesOf(begin_) + BytesOf(entries_) + BytesOf(moments_);
  }

 private:
  /// From a leaf's points.
  struct Seen {
    double sum = 0;
    bool clear = true;  ///< all of it, unoccluded
  };
  /// The means of the leaf's own links, and its ancestors' form factors at its centroid (its points). Returns
  /// what that sees.
  static Seen Fill(const Hierarchy& hierarchy, const Links& links, const Light& light, Index leaf,
                   double tolerance, std::span<Gathered> row, std::span<float> moments);
  /// Scales the row to what is seen: what it inherits, and where visibility does not blur what is seen, its
  /// own links too.
  static void Complete(const Seen& leaf, std::size_t own_count, std::span<Gathered> row);
  /// Scales the parts of each link into the element to its mean.
  void Balance(const Hierarchy& hierarchy, const Links& links, Index element,
               const std::vector<Index>& row_of);

  std::vector<Index> leaves_;
  std::vector<std::size_t> begin_;
  std::vector<Gathered> entries_;
  std::size_t shapes_ = 0;  // K − 1
  std::vector<float> moments_;
};

}  // namespace radbake
