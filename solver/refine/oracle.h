/// What distinguishes the methods of the family: which nodes may be linked.
#pragma once

#include "solver/refine/links.h"

namespace radbake {

enum class Decision { kKeep, kDivideReceiver, kDivideShooter };

/// The area of a node as oracles compare it: the sky's is what it looks like from the scene.
double ComparableArea(const Hierarchy& hierarchy, Index node);
/// Is it a cluster, or an element of more than this area?
bool IsDivisible(const Hierarchy& hierarchy, Index node, double largest_area);

/// Is area `a` at least `b`? Equal ones are, however the positions of a file are rounded: one scene is linked
/// alike wherever it stands.
bool IsAtLeast(double a, double b);

/// Judges a link that exists or would exist. Called from several threads at once.
class Oracle {
 public:
  Oracle() = default;
  Oracle(const Oracle&) = delete;
  Oracle& operator=(const Oracle&) = delete;
  virtual ~Oracle() = default;
  virtual Decision Judge(const Hierarchy& hierarchy, const Link& link) const = 0;
};

}  // namespace radbake
