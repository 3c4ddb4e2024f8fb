/// The rows of the transport operator K, one for each leaf: what it gathers, and from whom.
#pragma once

#include <span>
#include <vector>

#include "solver/hierarchy/light.h"
#include "solver/refine/links.h"

namespace radbake {

/// E_leaf = Σ weight · B_shooter, over the links into the leaf and into its ancestors.
struct Gathered {
  Index shooter = 0;
  float weight = 0;  ///< form factor from the leaf (of a light: its kernel) · visibility
};

/// A link into an ancestor holds the mean form factor over it, and a leaf may be far from that mean: where
/// patches touch, by so much that rows made of means sum to anything from 0.6 to 1.5, and the sum over all
/// bounces need not even converge. So a leaf has the form factors at its centroid for its ancestors' links,
/// beside the means of its own, scaled so that
/// - a row sums to what its leaf's centroid sees: to 1 in a closed convex room, whatever the oracle kept;
/// - a link brings its leaves together its mean, as near as the rows allow: energy is kept.
/// Both at once is matrix balancing (Sinkhorn 1967); rows, links, and rows again bring both below 0.5 % in
/// rooms of any shape.
class Rows {
 public:
  /// Of the leaves of `hierarchy` that are on surfaces; `light` says which parts of elements are open. The
  /// same bits on any number of threads.
  Rows(const Hierarchy& hierarchy, const Links& links, const Light& light);

  /// Of the given nodes, which have no links of their own: the means by area of their leaves' rows,
  ///   F_ij = Σ_q F_qj·A_q / A_i.
  Rows(const Hierarchy& hierarchy, const Rows& of_leaves, const std::vector<Index>& nodes);

  std::span<const Index> leaves() const { return leaves_; }
  /// The row of leaves()[k].
  std::span<const Gathered> operator[](std::size_t k) const {
    return std::span(entries_).subspan(begin_[k], begin_[k + 1] - begin_[k]);
  }

 private:
  /// By a leaf's centroid.
  struct Seen {
    double sum = 0;
    bool clear = true;  ///< all of it, unoccluded
  };
  /// The means of the leaf's own links, and its ancestors' form factors at its centroid. Returns what the
  /// centroid sees.
  static Seen Fill(const Hierarchy& hierarchy, const Links& links, const Light& light, Index leaf,
                   std::span<Gathered> row);
  /// Scales the row to what is seen: what it inherits, and where visibility does not blur what is seen, its
  /// own links too.
  static void Complete(const Seen& leaf, std::size_t own_count, std::span<Gathered> row);
  /// Scales the parts of each link into the element to its mean.
  void Balance(const Hierarchy& hierarchy, const Links& links, Index element,
               const std::vector<Index>& row_of);

  std::vector<Index> leaves_;
  std::vector<std::size_t> begin_;
  std::vector<Gathered> entries_;
};

}  // namespace radbake
