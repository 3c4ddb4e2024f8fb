#include "solver/check/bake_lookup.h"

#include <algorithm>
#include <limits>
#include <numeric>

namespace radbake {
namespace {

constexpr double kReach = 1e-4;   // of the scene's size: rounding to single precision far from the origin
constexpr double kSameWay = 0.9;  // cosine between normals

// Ericson: Real-time collision detection, 2005, section 5.1.5. Barycentric coordinates of the point of a
// triangle that is nearest to `point`.
Vec3 NearestInTriangle(const Corners& corners, const Vec3& point) {
  const auto& [a, b, c] = corners;
  const Vec3 ab = b - a;
  const Vec3 ac = c - a;
  const Vec3 ap = point - a;
  const double d1 = ab.dot(ap);
  const double d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) {
    return {1, 0, 0};
  }
  const Vec3 bp = point - b;
  const double d3 = ab.dot(bp);
  const double d4 = ac.dot(bp);
  if (d3 >= 0 && d4 <= d3) {
    return {0, 1, 0};
  }
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) {
    const double v = d1 / (d1 - d3);
    return {1 - v, v, 0};
  }
  const Vec3 cp = point - c;
  const double d5 = ab.dot(cp);
  const double d6 = ac.dot(cp);
  if (d6 >= 0 && d5 <= d6) {
    return {0, 0, 1};
  }
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) {
    const double w = d2 / (d2 - d6);
    return {1 - w, 0, w};
  }
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 >= d3 && d5 >= d6) {
    const double w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return {0, 1 - w, w};
  }
  return Vec3(va, vb, vc) / (va + vb + vc);
}

// A balanced k-d tree over places, in place: the median of each range divides it. The places are few and the
// triangles many, so it is the triangles that search.
class PlaceTree {
 public:
  explicit PlaceTree(std::span<const Place> places) : places_(places), order_(places.size()) {
    std::iota(order_.begin(), order_.end(), Index{0});
    Divide(0, order_.size(), 0);
  }

  template <typename Visit>
  void InBox(const Eigen::AlignedBox3d& box, const Visit& visit) const {
    InBox(box, visit, 0, order_.size(), 0);
  }

 private:
  double Coordinate(std::size_t position, int axis) const { return places_[order_[position]].point[axis]; }

  void Divide(std::size_t begin, std::size_t end, int axis) {
    if (end - begin < 2) {
      return;
    }
    const std::size_t middle = begin + (end - begin) / 2;
    const auto at = [&](std::size_t i) { return order_.begin() + static_cast<std::ptrdiff_t>(i); };
    std::nth_element(at(begin), at(middle), at(end),
                     [&](Index a, Index b) { return places_[a].point[axis] < places_[b].point[axis]; });
    Divide(begin, middle, (axis + 1) % 3);
    Divide(middle + 1, end, (axis + 1) % 3);
  }

  template <typename Visit>
  void InBox(const Eigen::AlignedBox3d& box, const Visit& visit, std::size_t begin, std::size_t end,
             int axis) const {
    if (begin == end) {
      return;
    }
    const std::size_t middle = begin + (end - begin) / 2;
    if (box.contains(places_[order_[middle]].point)) {
      visit(order_[middle]);
    }
    if (box.min()[axis] <= Coordinate(middle, axis)) {
      InBox(box, visit, begin, middle, (axis + 1) % 3);
    }
    if (box.max()[axis] >= Coordinate(middle, axis)) {
      InBox(box, visit, middle + 1, end, (axis + 1) % 3);
    }
  }

  std::span<const Place> places_;
  std::vector<Index> order_;
};

}  // namespace

std::vector<std::optional<Rgb>> LookUp(const BakedTriangles& baked, const UnitBox& normalization,
                                       std::span<const Place> places) {
  const PlaceTree tree(places);
  std::vector<std::optional<Rgb>> found(places.size());
  std::vector<double> nearest(places.size(), kReach);
  for (const Triangle& triangle : baked.triangles) {
    Corners corners;
    Eigen::AlignedBox3d box;
    for (std::size_t i = 0; i < 3; ++i) {
      corners[i] = normalization(baked.positions[triangle[i]]);
      box.extend(corners[i]);
    }
    const Vec3 cross = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    const double norm = cross.norm();
    box.min().array() -= kReach;
    box.max().array() += kReach;
    tree.InBox(box, [&](Index i) {
      if (!(places[i].normal.dot(cross) > kSameWay * norm)) {
        return;
      }
      const Vec3 weights = NearestInTriangle(corners, places[i].point);
      const Vec3 point = weights[0] * corners[0] + weights[1] * corners[1] + weights[2] * corners[2];
      if (const double distance = (point - places[i].point).norm(); distance < nearest[i]) {
        nearest[i] = distance;
        found[i] = weights[0] * baked.irradiance[triangle[0]] + weights[1] * baked.irradiance[triangle[1]] +
                   weights[2] * baked.irradiance[triangle[2]];
      }
    });
  }
  return found;
}

}  // namespace radbake
