#include "solver/bake/emitters.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "solver/transport/sampling.h"
#include "solver/transport/seen_polygon.h"

namespace radbake {
namespace {

constexpr std::size_t kFew = 16;

// Of form factors.
constexpr double kExactEnough = 1e-3;

double ShareOf(std::uint64_t key) {
  return static_cast<double>(key >> 11U) * 0x1p-53;
}

}  // namespace

Emitters::Node Emitters::Leaf(Index patch) const {
  return {.centre = hierarchy_.Centre(patch),
          .radius = hierarchy_.Radius(patch),
          .power = hierarchy_[patch].area * Luminance(hierarchy_.PatchOf(patch).emission),
          .patch = patch};
}

Emitters::Emitters(const Hierarchy& hierarchy) : hierarchy_(hierarchy) {
  for (Index patch = 0; patch < hierarchy.surface_root_count(); ++patch) {
    if (hierarchy.PatchOf(patch).emission.maxCoeff() > 0) {
      patches_.push_back(patch);
    }
  }
  if (patches_.size() <= kFew) {
    return;
  }
  const Clusters& clusters = hierarchy.clusters();
  std::vector<double> power(clusters.size(), 0.0);
  for (const Index patch : patches_) {
    power[clusters.Above(patch)] += Leaf(patch).power;
  }
  for (auto c = static_cast<Index>(clusters.size()); c-- > 1;) {
    power[clusters[c].parent] += power[c];
  }
  std::vector<Index> cluster_of(1, Index{0});
  nodes_.push_back({.centre = clusters[0].centre, .radius = clusters[0].radius, .power = power[0]});
  for (std::size_t at = 0; at < nodes_.size(); ++at) {
    if (nodes_[at].patch != kNone) {
      continue;
    }
    nodes_[at].begin = static_cast<Index>(nodes_.size());
    for (const Index child : clusters.Children(cluster_of[at])) {
      const Index cluster = child - kFirstCluster;
      if (IsElement(child) && hierarchy.PatchOf(child).emission.maxCoeff() > 0) {
        nodes_.push_back(Leaf(child));
        cluster_of.push_back(kNone);
      } else if (IsCluster(child) && power[cluster] > 0) {
        nodes_.push_back({.centre = clusters[cluster].centre,
                          .radius = clusters[cluster].radius,
                          .power = power[cluster]});
        cluster_of.push_back(cluster);
      }
    }
    nodes_[at].end = static_cast<Index>(nodes_.size());
  }
}

Estimate Emitters::At(const Visibility& visibility, const Vec3& x, const Vec3& n, double scale, double rays,
                      std::uint64_t key) const {
  return nodes_.empty() ? FromEach(visibility, x, n, scale, rays, key)
                        : FromSome(visibility, x, n, rays, key);
}

Estimate Emitters::FromEach(const Visibility& visibility, const Vec3& x, const Vec3& n, double scale,
                            double rays, std::uint64_t key) const {
  Estimate sum;
  QuasiRandom<2> random(key);
  for (const Index patch : patches_) {
    const Polygon shape = hierarchy_.Shape(patch);
    const Rgb open = PointToPolygon(x, n, shape, kExactEnough) * hierarchy_.PatchOf(patch).emission;
    if (!(open.maxCoeff() > 0)) {
      continue;
    }
    // What is worth less than one ray gets one by chance.
    constexpr double kLeast = 0.1;
    const double worth = std::max(kLeast, rays * std::min(1.0, Luminance(open) / scale));
    const double chance = std::min(1.0, worth);
    key = Hash(key);
    if (ShareOf(key) >= chance) {
      continue;
    }
    const int count = std::max(1, static_cast<int>(std::lround(worth)));
    const double visible = visibility.FromPoint(x, n, shape, random, count);
    sum.irradiance += visible / chance * open;
    sum.variance += (visible * (1 - visible) * VarianceOfHits(count) + visible * visible * (1 / chance - 1)) /
                    chance * open.square().sum();
  }
  return sum;
}

double Emitters::Importance(const Node& node, const Vec3& x, const Vec3& n) {
  const Vec3 along = node.centre - x;
  const double height = n.dot(along) + node.radius;
  if (!(height > 0)) {
    return 0;
  }
  const double distance = std::max(along.norm(), node.radius);
  return node.power * std::min(1.0, height / distance) / (distance * distance);
}

Estimate Emitters::FromSome(const Visibility& visibility, const Vec3& x, const Vec3& n, double rays,
                            std::uint64_t key) const {
  const int count = std::max(1, static_cast<int>(std::lround(rays)));
  QuasiRandom<2> random(key);
  Estimate sum;
  double squares = 0;
  constexpr double kBelowOne = 1 - 0x1p-53;
  const double offset = ShareOf(Hash(key));
  std::vector<double> importance;
  for (int k = 0; k < count; ++k) {
    double u = (k + offset) / count;
    double chance = 1;
    const Node* at = nodes_.data();
    while (at != nullptr && at->patch == kNone) {
      importance.clear();
      double total = 0;
      for (Index child = at->begin; child < at->end; ++child) {
        importance.push_back(Importance(nodes_[child], x, n));
        total += importance.back();
      }
      const Node* chosen = nullptr;
      double left = u * total;
      for (std::size_t child = 0; child < importance.size(); ++child) {
        if (left < importance[child]) {
          chosen = &nodes_[at->begin + child];
          u = std::min(left / importance[child], kBelowOne);
          chance *= importance[child] / total;
          break;
        }
        left -= importance[child];
      }
      at = chosen;
    }
    if (at == nullptr) {
      continue;
    }
    const Polygon shape = hierarchy_.Shape(at->patch);
    const double form_factor = PointToPolygon(x, n, shape, kExactEnough);
    if (form_factor > 0 && visibility.FromPoint(x, n, shape, random, 1) > 0) {
      const Rgb found = form_factor / (chance * count) * hierarchy_.PatchOf(at->patch).emission;
      sum.irradiance += found;
      squares += found.square().sum();
    }
  }
  sum.variance = std::max(0.0, squares - sum.irradiance.square().sum() / count);
  return sum;
}

}  // namespace radbake
