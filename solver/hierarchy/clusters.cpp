#include "solver/hierarchy/clusters.h"

#include <algorithm>
#include <numeric>

namespace radbake {
namespace {

constexpr Index kLeafSize = 4;
// A patch whose box is larger than this share of the cluster's hangs directly below it; but not too many do.
constexpr double kLarge = 0.5;
constexpr std::ptrdiff_t kMostLarge = 32;

Eigen::AlignedBox3d BoxOf(const Patch& patch) {
  Eigen::AlignedBox3d box;
  for (std::size_t k = 0; k < static_cast<std::size_t>(patch.corner_count); ++k) {
    box.extend(patch.corner[k]);
  }
  return box;
}

}  // namespace

Clusters::Clusters(const Patches& patches)
    : order_(patches.surface_patches), above_(patches.surface_patches) {
  std::iota(order_.begin(), order_.end(), Index{0});
  for (const Index patch : order_) {
    basis_.push_back(CosineBasis(patches.patches[patch].normal));
  }
  Build(patches, 0, static_cast<Index>(order_.size()), kNone);
  double area = 0;
  for (const Index patch : order_) {
    cumulative_.push_back(area += patches.patches[patch].area);
  }
}

void Clusters::Build(const Patches& patches, Index begin, Index end, Index parent) {
  const auto self = static_cast<Index>(clusters_.size());
  Cluster cluster;
  cluster.parent = parent;
  cluster.depth = parent == kNone ? 0 : clusters_[parent].depth + 1;
  cluster.patches_begin = begin;
  cluster.patches_end = end;
  Eigen::AlignedBox3d box;
  for (Index k = begin; k < end; ++k) {
    const Patch& patch = patches.patches[order_[k]];
    box.extend(BoxOf(patch));
    cluster.area += patch.area;
    cluster.reflectance = std::max(cluster.reflectance, patch.reflectance.maxCoeff());
    cluster.extent += static_cast<float>(patch.area) * basis_[order_[k]];
  }
  cluster.extent /= static_cast<float>(cluster.area);
  cluster.centre = box.center();
  cluster.radius = 0.5 * box.diagonal().norm();
  clusters_.push_back(cluster);

  const auto at = [&](Index k) { return order_.begin() + static_cast<std::ptrdiff_t>(k); };
  Index middle = end;  // what lies before hangs directly below
  if (end - begin > kLeafSize) {
    const auto large = std::stable_partition(at(begin), at(end), [&](Index patch) {
      return BoxOf(patches.patches[patch]).diagonal().norm() > 2 * kLarge * cluster.radius;
    });
    middle = large - at(begin) <= kMostLarge ? static_cast<Index>(large - order_.begin()) : begin;
  }
  std::vector<Index> children(at(begin), at(middle));
  for (const Index patch : children) {
    above_[patch] = self;
  }
  if (middle < end) {
    // The middle of the longest axis; the median where that leaves one side all but empty.
    Eigen::AlignedBox3d centres;
    for (Index k = middle; k < end; ++k) {
      centres.extend(BoxOf(patches.patches[order_[k]]).center());
    }
    Eigen::Index axis = 0;
    centres.sizes().maxCoeff(&axis);
    const auto coordinate = [&](Index patch) { return BoxOf(patches.patches[patch]).center()[axis]; };
    auto split = std::stable_partition(
        at(middle), at(end), [&](Index patch) { return coordinate(patch) < centres.center()[axis]; });
    constexpr std::ptrdiff_t kLeast = 8;  // one in so many
    const std::ptrdiff_t count = at(end) - at(middle);
    if (std::min(split - at(middle), at(end) - split) * kLeast < count) {
      split = at(middle) + count / 2;
      std::nth_element(at(middle), split, at(end), [&](Index a, Index b) {
        const double ca = coordinate(a);
        const double cb = coordinate(b);
        return ca != cb ? ca < cb : a < b;
      });
    }
    const auto cut = static_cast<Index>(split - order_.begin());
    for (const auto& [from, to] : {std::pair(middle, cut), std::pair(cut, end)}) {
      if (to - from == 1) {
        children.push_back(order_[from]);
        above_[order_[from]] = self;
      } else if (from < to) {
        children.push_back(ClusterNode(static_cast<Index>(clusters_.size())));
        Build(patches, from, to, self);
      }
    }
  }
  clusters_[self].children_begin = static_cast<Index>(children_.size());
  children_.insert(children_.end(), children.begin(), children.end());
  clusters_[self].children_end = static_cast<Index>(children_.size());
}

Index Clusters::PatchAt(Index cluster, double& u) const {
  const Cluster& c = clusters_[cluster];
  const double before = c.patches_begin > 0 ? cumulative_[c.patches_begin - 1] : 0;
  const double target = before + u * (cumulative_[c.patches_end - 1] - before);
  const auto first = cumulative_.begin() + static_cast<std::ptrdiff_t>(c.patches_begin);
  const auto last = cumulative_.begin() + static_cast<std::ptrdiff_t>(c.patches_end) - 1;
  const auto found = std::upper_bound(first, last, target);
  const auto k = static_cast<std::size_t>(found - cumulative_.begin());
  const double begin = k > 0 ? cumulative_[k - 1] : 0;
  const double area = cumulative_[k] - begin;
  constexpr double kBelowOne = 1 - 0x1p-53;
  u = area > 0 ? std::clamp((target - begin) / area, 0.0, kBelowOne) : 0;
  return order_[k];
}

}  // namespace radbake
