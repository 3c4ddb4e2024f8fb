/// What distinguishes the methods of the family: which nodes may be linked.
#pragma once

#include "solver/refine/links.h"

namespace radbake {

enum class Decision { kKeep, kDivideReceiver, kDivideShooter };

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
