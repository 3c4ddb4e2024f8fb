/// What links carry of shooters that are uneven.
#pragma once

#include <span>
#include <vector>

#include "solver/hierarchy/light.h"
#include "solver/refine/links.h"
#include "solver/transport/visibility.h"

namespace radbake {

/// The couplings of each link between elements, but for what even light gives: of φ_1 … of the shooter with
/// φ_0 … of the receiver, K × (K − 1) numbers a link. (How the form factor varies over a receiver is in its
/// leaves' rows, at their own points: see Rows.) A partly occluded link carries all of them as dimmed as its
/// mean, and on the whole what its hidden part makes of them (HiddenMoments). Nothing is held if K = 1, and
/// links whose shooter is even couple with 0.
class Couplings {
 public:
  /// The same bits on any number of threads.
  Couplings(const Hierarchy& hierarchy, const Visibility& visibility, const Links& links, const Light& light);

  /// Coefficients of what the element gathers from uneven shooters, added to `gathered`. `shooting`: K an
  /// element.
  void Gather(const Links& links, Index element, std::span<const Rgb> shooting, Coefficients gathered) const;

  /// Of memory, in a basis of `count`.
  static std::size_t BytesNeeded(const Links& links, std::size_t count) {
    return links.size() * count * (count - 1) * sizeof(float);
  }
  std::size_t Bytes() const { return BytesOf(couplings_); }

 private:
  std::size_t count_;
  std::vector<float> couplings_;  // by link
};

}  // namespace radbake
