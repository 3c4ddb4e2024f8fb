/// The link store: interactions between nodes of the hierarchy, kept at the receiver.
#pragma once

#include <span>
#include <vector>

#include "solver/hierarchy/hierarchy.h"
#include "solver/scene/bytes.h"

namespace radbake {

/// Light from `shooter` to `receiver`: E_receiver += form_factor · visibility · B_shooter. The receiver is an
/// element or a cluster, the shooter any node; see nodes.h.
struct Link {
  Index receiver = 0;
  Index shooter = 0;
  float form_factor = 0;  ///< F from receiver to shooter, unoccluded; from a light, irradiance per intensity
  float judged_factor = 0;  ///< the same, where rays measure it from others than carry, for oracles
  float variation = 0;    ///< largest difference of the point-to-shooter form factor over the receiver, less
                          ///< what a higher basis explains of it
  float visibility = 1;   ///< share of the light that is not blocked, sampled: see SampledVisibility::carried
  float judged = 1;       ///< the same from other rays, for oracles: see SampledVisibility
  Index first_share = 0;  ///< see Links::SourcesOf and Links::ReceiversOf
  std::uint16_t source_count = 0;
  std::uint16_t receiver_count = 0;
  bool clear = false;    ///< proved unoccluded
  bool carried = false;  ///< form_factor and visibility are not what oracles judge by
};

/// All links, sorted by receiver, and the shares of the patches of clusters that they join. Receivers own
/// their links, so threads share nothing while gathering.
class Links {
 public:
  /// Replaces all; their order within a receiver is kept.
  void Assign(const std::vector<Link>& links, std::size_t element_count, std::size_t cluster_count,
              std::vector<PatchShare> shares = {});

  std::span<const Link> all() const { return links_; }
  std::size_t size() const { return links_.size(); }
  /// From a cluster, the patches that the link's rays met, which stand for all that its receiver sees of it;
  /// none if they met none, or what the link carries has not been measured.
  std::span<const PatchShare> SourcesOf(const Link& link) const {
    return std::span(shares_).subspan(link.first_share, link.source_count);
  }
  /// Into a cluster of few patches, those that the link's light falls on; none as above.
  std::span<const PatchShare> ReceiversOf(const Link& link) const {
    return std::span(shares_).subspan(link.first_share + link.source_count, link.receiver_count);
  }
  /// Sources and receivers of all links.
  std::span<const PatchShare> shares() const { return shares_; }
  /// The links into one element or cluster; none if it is younger than the last Assign().
  std::span<const Link> Into(Index receiver) const {
    const std::size_t row = Row(receiver);
    if (row + 1 >= begin_.size()) {
      return {};
    }
    return std::span(links_).subspan(begin_[row], begin_[row + 1] - begin_[row]);
  }

  /// Of memory.
  std::size_t Bytes() const { return BytesOf(links_) + BytesOf(begin_) + BytesOf(shares_); }

 private:
  /// Clusters first: their number never changes.
  std::size_t Row(Index receiver) const {
    return IsCluster(receiver) ? receiver - kFirstCluster : cluster_count_ + receiver;
  }

  std::size_t cluster_count_ = 0;
  std::vector<Link> links_;
  std::vector<std::size_t> begin_;
  std::vector<PatchShare> shares_;
};

}  // namespace radbake
