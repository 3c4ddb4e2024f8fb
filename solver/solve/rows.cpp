#include "solver/solve/rows.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <map>

#include "solver/transport/node_transport.h"

namespace radbake {

Rows::Rows(const Hierarchy& hierarchy, const Links& links, const Light& light) : begin_(1, 0) {
  for (Index leaf = 0; leaf < hierarchy.size(); ++leaf) {
    if (hierarchy[leaf].IsLeaf() && !hierarchy.IsSky(leaf)) {
      std::size_t count = 0;
      for (Index e = leaf; e != kNone; e = hierarchy[e].parent) {
        count += links.Into(e).size();
      }
      leaves_.push_back(leaf);
      begin_.push_back(begin_.back() + count);
    }
  }
  entries_.resize(begin_.back());
  constexpr std::size_t kGrain = 16;
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, leaves_.size(), kGrain), [&](const auto& range) {
    for (std::size_t k = range.begin(); k != range.end(); ++k) {
      Fill(hierarchy, links, light, leaves_[k],
           std::span(entries_).subspan(begin_[k], begin_[k + 1] - begin_[k]));
    }
  });
}

Rows::Rows(const Hierarchy& hierarchy, const Rows& of_leaves, const std::vector<Index>& nodes)
    : leaves_(nodes), begin_(1, 0) {
  std::vector<Index> node_of(hierarchy.size(), kNone);
  for (Index k = 0; k < nodes.size(); ++k) {
    node_of[nodes[k]] = k;
  }
  std::vector<std::map<Index, double>> sums(nodes.size());
  std::vector<double> areas(nodes.size());
  for (std::size_t k = 0; k < of_leaves.leaves().size(); ++k) {
    const Index leaf = of_leaves.leaves()[k];
    Index above = leaf;
    while (node_of[above] == kNone) {
      above = hierarchy[above].parent;
    }
    const Index node = node_of[above];
    areas[node] += hierarchy[leaf].area;
    for (const Gathered& entry : of_leaves[k]) {
      sums[node][entry.shooter] += hierarchy[leaf].area * static_cast<double>(entry.weight);
    }
  }
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    for (const auto& [shooter, sum] : sums[k]) {
      entries_.push_back({shooter, static_cast<float>(sum / areas[k])});
    }
    begin_.push_back(entries_.size());
  }
}

void Rows::Fill(const Hierarchy& hierarchy, const Links& links, const Light& light, Index leaf,
                std::span<Gathered> row) const {
  const Polygon shape = hierarchy.Shape(leaf);
  const Vec3 centroid = shape.Centroid();
  const auto at_centroid = [&](const Link& link) {
    return static_cast<double>(link.visibility) *
           UnoccludedAt(hierarchy, centroid, shape.normal, link.shooter);
  };
  std::size_t at = 0;
  const std::span<const Link> own = links.Into(leaf);
  const bool has_more = own.size() < row.size();
  double missed = 0;  // by the means of the leaf's own links, of what the centroid sees
  for (const Link& link : own) {
    const auto mean = static_cast<double>(link.visibility * link.form_factor);
    missed += has_more ? at_centroid(link) - mean : 0;
    row[at++] = {link.shooter, static_cast<float>(mean)};
  }
  double above = 0;
  for (Index e = hierarchy[leaf].parent; e != kNone; e = hierarchy[e].parent) {
    // What an element gathers falls on its open parts alone.
    const double open = light.open[e] > 0 ? light.open[leaf] / light.open[e] : 1;
    for (const Link& link : links.Into(e)) {
      const double weight = at_centroid(link);
      above += weight;
      row[at++] = {link.shooter, static_cast<float>(open * weight)};
    }
  }
  if (above > 0) {
    // Where few and unimportant links are left to the ancestors, they cannot bear it all.
    constexpr double kMost = 2;
    const auto kappa = static_cast<float>(std::clamp(1 + missed / above, 1 / kMost, kMost));
    for (Gathered& entry : row.subspan(own.size())) {
      entry.weight *= kappa;
    }
  }
}

}  // namespace radbake
