#include "solver/solve/rows.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <map>
#include <optional>

#include "solver/transport/coupling.h"
#include "solver/transport/node_transport.h"

namespace radbake {

namespace {

/// Where few and unimportant links are left to be scaled, they cannot bear it all.
double Bearable(double factor) {
  constexpr double kMost = 2;
  return std::clamp(factor, 1 / kMost, kMost);
}

/// Calls `visit` with all leaves below an element.
template <typename Visit>
void ForEachLeafBelow(const Hierarchy& hierarchy, Index e, const Visit& visit) {
  if (hierarchy[e].IsLeaf()) {
    visit(e);
    return;
  }
  for (Index child = hierarchy[e].first_child; child < hierarchy[e].first_child + 4; ++child) {
    ForEachLeafBelow(hierarchy, child, visit);
  }
}

std::size_t LengthOfRow(const Hierarchy& hierarchy, const Links& links, Index leaf) {
  std::size_t count = 0;
  for (Index e = leaf; e != kNone; e = hierarchy[e].parent) {
    count += links.Into(e).size();
  }
  return count;
}

}  // namespace

std::size_t Rows::BytesNeeded(const Hierarchy& hierarchy, const Links& links, const Light& light) {
  std::size_t entries = 0;
  std::size_t leaves = 0;
  for (Index e = 0; e < hierarchy.size(); ++e) {
    if (hierarchy[e].IsLeaf() && !hierarchy.IsSky(e)) {
      entries += LengthOfRow(hierarchy, links, e);
      ++leaves;
    }
  }
  return entries * (sizeof(Gathered) + (light.basis.count() - 1) * sizeof(float)) +
         leaves * (sizeof(Index) + sizeof(std::size_t) + sizeof(Seen)) + hierarchy.size() * sizeof(Index);
}

Rows::Rows(const Hierarchy& hierarchy, const Links& links, const Light& light)
    : begin_(1, 0), shapes_(light.basis.count() - 1) {
  std::vector<Index> row_of(hierarchy.size(), kNone);
  for (Index leaf = 0; leaf < hierarchy.size(); ++leaf) {
    if (hierarchy[leaf].IsLeaf() && !hierarchy.IsSky(leaf)) {
      const std::size_t count = LengthOfRow(hierarchy, links, leaf);
      row_of[leaf] = static_cast<Index>(leaves_.size());
      leaves_.push_back(leaf);
      begin_.push_back(begin_.back() + count);
    }
  }
  entries_.resize(begin_.back());
  moments_.resize(shapes_ * begin_.back());
  const double tolerance = FormFactorTolerance(hierarchy.patches());
  std::vector<Seen> seen(leaves_.size());
  constexpr std::size_t kGrain = 16;
  const auto for_each_row = [&](const auto& visit) {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, leaves_.size(), kGrain), [&](const auto& range) {
      for (std::size_t k = range.begin(); k != range.end(); ++k) {
        visit(k, std::span(entries_).subspan(begin_[k], begin_[k + 1] - begin_[k]));
      }
    });
  };
  for_each_row([&](std::size_t k, std::span<Gathered> row) {
    seen[k] = Fill(hierarchy, links, light, leaves_[k], tolerance, row,
                   std::span(moments_).subspan(shapes_ * begin_[k], shapes_ * row.size()));
    Complete(seen[k], links.Into(leaves_[k]).size(), row);
  });
  tbb::parallel_for(std::size_t{0}, hierarchy.size(),
                    [&](std::size_t e) { Balance(hierarchy, links, static_cast<Index>(e), row_of); });
  for_each_row(
      [&](std::size_t k, std::span<Gathered> row) { Complete(seen[k], links.Into(leaves_[k]).size(), row); });
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

Rows::Seen Rows::Fill(const Hierarchy& hierarchy, const Links& links, const Light& light, Index leaf,
                      double tolerance, std::span<Gathered> row, std::span<float> moments) {
  const Basis& basis = light.basis;
  const BasisEnd receiver(hierarchy, basis, leaf);
  const bool shaped = basis.count() > 1 && light.open[leaf] == 1;
  std::size_t at = 0;
  // At the points, times `open`: the mean, and the moments into their place.
  const auto look = [&](const Link& link, double open) {
    if (IsCluster(link.shooter)) {
      // From one point nothing better is known than what rays say from all: all of a cluster in its middle
      // would keep no energy.
      return static_cast<double>(link.visibility * link.form_factor);
    }
    const Vec3& normal = receiver.seen.shape().normal;
    std::optional<SeenPolygon> shooter;
    if (IsElement(link.shooter)) {
      shooter.emplace(hierarchy.Shape(link.shooter));
    }
    const BasisValues sums = MomentsOver(receiver, [&](const Vec3& x) {
      return shooter ? shooter->From(x, normal, tolerance) : UnoccludedAt(hierarchy, x, normal, link.shooter);
    });
    const auto visibility = static_cast<double>(link.visibility);
    for (std::size_t i = 1; shaped && i < basis.count(); ++i) {
      moments[(basis.count() - 1) * at + i - 1] = static_cast<float>(open * (visibility * sums[i]));
    }
    return visibility * sums[0];
  };
  Seen seen;
  for (const Link& link : links.Into(leaf)) {
    seen.sum += look(link, 1);
    row[at++] = {GatheredFrom(links, link), link.visibility * link.form_factor};
    seen.clear = seen.clear && link.clear;
  }
  for (Index e = hierarchy[leaf].parent; e != kNone; e = hierarchy[e].parent) {
    // What an element gathers falls on its open parts alone.
    const double open = light.open[e] > 0 ? light.open[leaf] / light.open[e] : 1;
    for (const Link& link : links.Into(e)) {
      const double weight = open * look(link, open);
      row[at++] = {GatheredFrom(links, link), static_cast<float>(weight)};
      seen.sum += weight;
      seen.clear = seen.clear && link.clear;
    }
  }
  return seen;
}

void Rows::Complete(const Seen& leaf, std::size_t own_count, std::span<Gathered> row) {
  const auto sum_of = [](std::span<const Gathered> entries) {
    double sum = 0;
    for (const Gathered& entry : entries) {
      sum += static_cast<double>(entry.weight);
    }
    return sum;
  };
  const auto scale = [](std::span<Gathered> entries, double factor) {
    for (Gathered& entry : entries) {
      entry.weight *= static_cast<float>(factor);
    }
  };
  const std::span<Gathered> inherited = row.subspan(own_count);
  const double above = sum_of(inherited);
  if (!(above > 0)) {
    return;
  }
  scale(inherited, Bearable((leaf.sum - sum_of(row.first(own_count))) / above));
  if (const double sum = sum_of(row); leaf.clear && sum > 0) {
    scale(row, Bearable(leaf.sum / sum));
  }
}

void Rows::Balance(const Hierarchy& hierarchy, const Links& links, Index element,
                   const std::vector<Index>& row_of) {
  const std::span<const Link> own = links.Into(element);
  if (own.empty() || hierarchy[element].IsLeaf()) {
    return;
  }
  const auto for_each_part = [&](const auto& visit) {
    ForEachLeafBelow(hierarchy, element, [&](Index leaf) {
      std::size_t at = begin_[row_of[leaf]];
      for (Index e = leaf; e != element; e = hierarchy[e].parent) {
        at += links.Into(e).size();
      }
      visit(hierarchy[leaf].area, std::span(entries_).subspan(at, own.size()));
    });
  };
  std::vector<double> factor(own.size());
  for_each_part([&](double area, std::span<const Gathered> entries) {
    for (std::size_t i = 0; i < own.size(); ++i) {
      factor[i] += area * static_cast<double>(entries[i].weight);
    }
  });
  for (std::size_t i = 0; i < own.size(); ++i) {
    const double mean = hierarchy[element].area * static_cast<double>(own[i].visibility * own[i].form_factor);
    factor[i] = own[i].clear && factor[i] > 0 ? Bearable(mean / factor[i]) : 1;
  }
  for_each_part([&](double, std::span<Gathered> entries) {
    for (std::size_t i = 0; i < own.size(); ++i) {
      entries[i].weight *= static_cast<float>(factor[i]);
    }
  });
}

}  // namespace radbake
