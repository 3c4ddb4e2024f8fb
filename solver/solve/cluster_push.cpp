#include "solver/solve/cluster_push.h"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>

namespace radbake {
namespace {

/// Calls `visit` with every link into a cluster, and with the patches that its rays left from.
template <typename Visit>
void ForEachLinkIntoClusters(const Hierarchy& hierarchy, const Links& links, const Visit& visit) {
  for (Index c = 0; c < hierarchy.clusters().size(); ++c) {
    for (const Link& link : links.Into(ClusterNode(c))) {
      visit(link, links.ReceiversOf(link));
    }
  }
}

}  // namespace

ClusterPush::ClusterPush(const Hierarchy& hierarchy, const Links& links, const Light& light)
    : hierarchy_(hierarchy),
      links_(links),
      light_(light),
      scale_(hierarchy.surface_root_count(), 1.0),
      begin_(hierarchy.surface_root_count() + 1, 0),
      aperture_(light.aperture),
      enclosed_(light.enclosed) {
  std::size_t count = 0;
  ForEachLinkIntoClusters(hierarchy, links, [&](const Link&, const auto& receivers) {
    ++count;
    for (const PatchShare& receiver : receivers) {
      ++begin_[receiver.patch + 1];
    }
  });
  by_orientation_.resize(count, 0);
  for (std::size_t patch = 1; patch < begin_.size(); ++patch) {
    begin_[patch] += begin_[patch - 1];
  }
  entries_.resize(begin_.back());
  ScaleLinks();
}

std::size_t ClusterPush::BytesNeeded(const Hierarchy& hierarchy, const Links& links) {
  const std::size_t clusters = hierarchy.clusters().size();
  const std::size_t patches = clusters > 0 ? hierarchy.surface_root_count() : 0;
  std::size_t receivers = 0;
  ForEachLinkIntoClusters(hierarchy, links, [&](const Link&, const auto& all) { receivers += all.size(); });
  return receivers * sizeof(Gathered) +
         patches * (2 * sizeof(std::size_t) + 3 * sizeof(double) + sizeof(Rgb)) +
         clusters * (sizeof(CosineSum) + sizeof(double) + sizeof(Incident));
}

void ClusterPush::ScaleLinks() {
  // Of a link's light, the share that must find its place where its rays left from, or they are no sample of
  // it.
  constexpr double kEnough = 0.25;
  std::vector<std::size_t> next(begin_.begin(), begin_.end() - 1);
  ForEachLinkIntoClusters(hierarchy_, links_, [&](const Link& link, const auto& receivers) {
    double sum = 0;
    for (const PatchShare& receiver : receivers) {
      sum += scale_[receiver.patch] * static_cast<double>(receiver.share);
    }
    const double power =
        hierarchy_.Area(link.receiver) * static_cast<double>(link.form_factor * link.visibility);
    by_orientation_[IndexOf(link)] |= sum < kEnough ? 1 : 0;
    for (const PatchShare& receiver : receivers) {
      const double share = scale_[receiver.patch] * static_cast<double>(receiver.share);
      const double weight =
          by_orientation_[IndexOf(link)] == 0 ? power * share / sum / hierarchy_[receiver.patch].area : 0;
      entries_[next[receiver.patch]++] = {GatheredFrom(links_, link), static_cast<float>(weight)};
    }
  });
  const Clusters& clusters = hierarchy_.clusters();
  tbb::parallel_for(Index{0}, static_cast<Index>(clusters.size()), [&](Index c) {
    if (links_.Into(ClusterNode(c)).empty()) {
      return;
    }
    aperture_[c].setZero();
    enclosed_[c] = 0;
    for (const Index patch : clusters.PatchesBelow(c)) {
      const double open = hierarchy_[patch].area / clusters[c].area * light_.open[patch] * scale_[patch];
      aperture_[c] += static_cast<float>(open * light_.openness.Share(patch, clusters[c].depth)) *
                      clusters.BasisOf(patch);
      enclosed_[c] += open * light_.openness.Enclosed(patch, clusters[c].depth);
    }
  });
}

ClusterPush::Incident ClusterPush::CollectOn(Index c, const Shooters& shooters) const {
  Incident incident;
  const CosineSum& aperture = aperture_[c];
  for (const Link& link : links_.Into(ClusterNode(c))) {
    if (by_orientation_[IndexOf(link)] == 0) {
      continue;
    }
    const Rgb mean =
        static_cast<double>(link.form_factor * link.visibility) * shooters.Of(GatheredFrom(links_, link));
    if (link.shooter == link.receiver && enclosed_[c] > 0) {
      incident.inside += mean / enclosed_[c];
      continue;
    }
    const Eigen::RowVector3f row = mean.cast<float>().matrix().transpose();
    // Light from one direction falls on the patches by their orientation; its mean over them is the link's.
    constexpr double kHardly = 0.02;
    if (link.shooter != link.receiver) {
      const CosineSum basis =
          CosineBasis(DirectionTo(hierarchy_, link.shooter, hierarchy_.clusters()[c].centre));
      const double facing = Evaluate(aperture, basis);
      if (facing > kHardly * static_cast<double>(aperture[0])) {
        incident.outside += ((basis / static_cast<float>(facing)).matrix() * row).array();
        continue;
      }
    }
    if (aperture[0] > 0) {
      incident.outside.row(0) += row.array() / aperture[0];
    }
  }
  return incident;
}

std::vector<Rgb> ClusterPush::Push(const Shooters& shooters) const {
  const Clusters& clusters = hierarchy_.clusters();
  std::vector<Incident> incident(clusters.size());
  tbb::parallel_for(Index{0}, static_cast<Index>(clusters.size()),
                    [&](Index c) { incident[c] = CollectOn(c, shooters); });
  std::vector<Rgb> irradiance(hierarchy_.surface_root_count(), Rgb::Zero());
  tbb::parallel_for(Index{0}, static_cast<Index>(irradiance.size()), [&](Index patch) {
    Rgb& sum = irradiance[patch];
    for (Index c = clusters.Above(patch); c != kNone; c = clusters[c].parent) {
      if (!links_.Into(ClusterNode(c)).empty()) {
        const std::uint32_t depth = clusters[c].depth;
        // As the aperture counts it, on the open part alone.
        sum += scale_[patch] * light_.open[patch] *
               (light_.openness.Share(patch, depth) * Evaluate(incident[c].outside, clusters.BasisOf(patch)) +
                light_.openness.Enclosed(patch, depth) * incident[c].inside);
      }
    }
    for (std::size_t k = begin_[patch]; k < begin_[patch + 1]; ++k) {
      sum += static_cast<double>(entries_[k].weight) * shooters.Of(entries_[k].shooter);
    }
  });
  return irradiance;
}

void ClusterPush::Balance(const Shooters& even, std::span<const double> seen) {
  constexpr int kRounds = 3;
  std::vector<double> room;
  for (int round = 0; round < kRounds; ++round) {
    const std::vector<Rgb> pushed = Push(even);
    for (Index patch = 0; patch < pushed.size(); ++patch) {
      const double own = pushed[patch][0];
      if (round == 0) {
        room.push_back(std::max(0.0, light_.open[patch] - (seen[patch] - own)));
      }
      if (own > 0) {
        scale_[patch] = std::min(1.0, scale_[patch] * room[patch] / own);
      }
    }
    ScaleLinks();
  }
}

}  // namespace radbake
