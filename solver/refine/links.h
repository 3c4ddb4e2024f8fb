/// The link store: interactions between nodes of the hierarchy, kept at the receiver.
#pragma once

#include <span>
#include <vector>

#include "solver/hierarchy/hierarchy.h"

namespace radbake {

/// Light from `shooter` to `receiver`: E_receiver += form_factor · visibility · B_shooter.
struct Link {
  Index receiver = 0;
  Index shooter = 0;
  float form_factor = 0;  ///< F from receiver to shooter, unoccluded
  float variation = 0;    ///< largest difference of the point-to-shooter form factor over the receiver
  float visibility = 1;   ///< share of the light that is not blocked, sampled
  float judged = 1;       ///< the same from other rays, for oracles: see SampledVisibility
  bool clear = false;     ///< proved unoccluded
};

/// All links, sorted by receiver. Receivers own their links, so threads share nothing while gathering.
class Links {
 public:
  /// Replaces all; their order within a receiver is kept.
  void Assign(const std::vector<Link>& links, std::size_t element_count);

  std::span<const Link> all() const { return links_; }
  std::size_t size() const { return links_.size(); }
  /// The links into one element; none if it is younger than the last Assign().
  std::span<const Link> Into(Index receiver) const {
    if (receiver + 1 >= begin_.size()) {
      return {};
    }
    return std::span(links_).subspan(begin_[receiver], begin_[receiver + 1] - begin_[receiver]);
  }

 private:
  std::vector<Link> links_;
  std::vector<std::size_t> begin_;
};

}  // namespace radbake
