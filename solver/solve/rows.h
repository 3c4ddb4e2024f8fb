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
/// bounces need not even converge. So a leaf has the form factors at its centroid c for its ancestors' links,
/// beside the means F̄ of its own, and the row is completed to what the centroid sees,
///   κ = (Σ_all V·F(c) − Σ_own V·F̄) / Σ_ancestors' V·F(c):
/// in a closed convex room every row sums to 1, whatever the oracle kept.
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
  void Fill(const Hierarchy& hierarchy, const Links& links, const Light& light, Index leaf,
            std::span<Gathered> row) const;

  std::vector<Index> leaves_;
  std::vector<std::size_t> begin_;
  std::vector<Gathered> entries_;
};

}  // namespace radbake
