#include "solver/transport/shaft.h"

#include <algorithm>

namespace radbake {
namespace {

// Overlaps below this, in the unit-sized scene, are rounding: surfaces that touch there.
constexpr double kTouch = 1e-9;

Eigen::AlignedBox3d BoxOf(const std::array<Vec3, 3>& triangle) {
  Eigen::AlignedBox3d box;
  for (const Vec3& corner : triangle) {
    box.extend(corner);
  }
  return box;
}

/// The largest value of n·x over the box, and the smallest as −Support(box, −n).
double Support(const Eigen::AlignedBox3d& box, const Vec3& n) {
  double sum = 0;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    sum += n[axis] * (n[axis] > 0 ? box.max()[axis] : box.min()[axis]);
  }
  return sum;
}

bool HasAllOnOneSide(const Plane& plane, std::span<const Vec3> points) {
  double low = 0;
  double high = 0;
  for (const Vec3& point : points) {
    const double d = plane.Distance(point);
    low = std::min(low, d);
    high = std::max(high, d);
    if (low < -kTouch && high > kTouch) {
      return false;
    }
  }
  return true;
}

Plane PlaneOf(const std::array<Vec3, 3>& triangle) {
  const Vec3 n = (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]).normalized();
  return {n, n.dot(triangle[0])};
}

/// Points in blocks with boxes, so that of a plane along the outside of a scene few of them are asked.
/// Neighbours in a mesh are near one another in its file.
class PointBlocks {
 public:
  explicit PointBlocks(std::span<const Vec3> points) : points_(points) {
    for (std::size_t begin = 0; begin < points.size(); begin += kSize) {
      Eigen::AlignedBox3d& box = boxes_.emplace_back();
      for (const Vec3& point : Block(boxes_.size() - 1)) {
        box.extend(point);
      }
    }
  }

  /// As HasAllOnOneSide() of all.
  bool HaveAllOnOneSide(const Plane& plane) const {
    bool below = false;
    bool above = false;
    for (std::size_t k = 0; k < boxes_.size(); ++k) {
      const double middle = plane.Distance(boxes_[k].center());
      const double reach = 0.5 * plane.normal.cwiseAbs().dot(boxes_[k].sizes()) + kTouch;
      if ((below || middle - reach >= -kTouch) && (above || middle + reach <= kTouch)) {
        continue;
      }
      for (const Vec3& point : Block(k)) {
        const double d = plane.Distance(point);
        below = below || d < -kTouch;
        above = above || d > kTouch;
      }
      if (below && above) {
        return false;
      }
    }
    return true;
  }

 private:
  static constexpr std::size_t kSize = 128;
  std::span<const Vec3> Block(std::size_t k) const {
    return points_.subspan(kSize * k, std::min(kSize, points_.size() - kSize * k));
  }

  std::span<const Vec3> points_;
  std::vector<Eigen::AlignedBox3d> boxes_;
};

}  // namespace

Shaft::Shaft(const Polygon& a, const Polygon& b) {
  Eigen::AlignedBox3d box_a;
  Eigen::AlignedBox3d box_b;
  for (int k = 0; k < a.count; ++k) {
    box_a.extend(a[k]);
    ends_[end_count_++] = a[k];
  }
  for (int k = 0; k < b.count; ++k) {
    box_b.extend(b[k]);
    ends_[end_count_++] = b[k];
  }
  box_ = box_a.merged(box_b);
  for (const Polygon* polygon : {&a, &b}) {
    const Plane plane = PlaneOf(*polygon);
    planes_[plane_count_++] = {-plane.normal, -plane.offset};
  }
  // In each coordinate plane, the sides of the hull of two rectangles that are not sides of their common box
  // join equal corners of the two.
  for (Eigen::Index u = 0; u < 3; ++u) {
    const Eigen::Index v = (u + 1) % 3;
    for (const int corner : {0, 1, 2, 3}) {
      const auto at = [&](const Eigen::AlignedBox3d& box) {
        return Eigen::Vector2d((corner & 1) != 0 ? box.max()[u] : box.min()[u],
                               (corner & 2) != 0 ? box.max()[v] : box.min()[v]);
      };
      const Eigen::Vector2d along = at(box_b) - at(box_a);
      if (std::abs(along[0]) <= kTouch || std::abs(along[1]) <= kTouch) {
        continue;
      }
      Plane plane{Vec3::Zero(), 0};
      plane.normal[u] = -along[1];
      plane.normal[v] = along[0];
      plane.normal.normalize();
      // Outwards is where this corner is from the box's middle.
      const double outwards = plane.normal[u] * ((corner & 1) != 0 ? 1 : -1) * box_a.sizes()[u] +
                              plane.normal[v] * ((corner & 2) != 0 ? 1 : -1) * box_a.sizes()[v];
      if (outwards < 0) {
        plane.normal = -plane.normal;
      }
      plane.offset = plane.normal[u] * at(box_a)[0] + plane.normal[v] * at(box_a)[1];
      if (Support(box_a, plane.normal) <= plane.offset + kTouch &&
          Support(box_b, plane.normal) <= plane.offset + kTouch) {
        planes_[plane_count_++] = plane;
      }
    }
  }
}

bool Shaft::MayMeet(const Eigen::AlignedBox3d& box) const {
  if (((box.min() - box_.max()).array() > 0).any() || ((box_.min() - box.max()).array() > 0).any()) {
    return false;
  }
  return std::none_of(planes_.begin(), planes_.begin() + static_cast<std::ptrdiff_t>(plane_count_),
                      [&](const Plane& plane) { return -Support(box, -plane.normal) >= plane.offset; });
}

bool Shaft::MayBlock(const std::array<Vec3, 3>& triangle) const {
  const Eigen::AlignedBox3d box = BoxOf(triangle);
  if (((box.min() - box_.max()).array() >= -kTouch).any() ||
      ((box_.min() - box.max()).array() >= -kTouch).any()) {
    // Flat boxes that coincide (a triangle in the face of the shaft's box) are for the plane test below to
    // judge.
    const Vec3 thick = box.sizes();
    if ((thick.array() > kTouch).all()) {
      return false;
    }
  }
  for (std::size_t k = 0; k < plane_count_; ++k) {
    if (std::all_of(triangle.begin(), triangle.end(),
                    [&](const Vec3& corner) { return planes_[k].Distance(corner) >= -kTouch; })) {
      return false;
    }
  }
  return !HasAllOnOneSide(PlaneOf(triangle), {ends_.data(), end_count_});
}

Occluders::Occluders(const Patches& patches) {
  const std::span<const Blocker> blockers = patches.blockers;
  // A plane with all corners of the scene on one side has the extreme corners there too: a quick rejection.
  std::vector<Vec3> corners;
  for (const Blocker& blocker : blockers) {
    corners.insert(corners.end(), blocker.corner.begin(), blocker.corner.end());
  }
  bool light_from_afar = patches.surface_patches < patches.patches.size();
  for (const PunctualLight& light : patches.lights) {
    corners.push_back(light.position);
    light_from_afar = light_from_afar || light.kind == PunctualLight::Kind::kDirectional;
  }
  std::vector<Vec3> extremes;
  for (const double x : {-1, 0, 1}) {
    for (const double y : {-1, 0, 1}) {
      for (const double z : {-1, 0, 1}) {
        const Vec3 d(x, y, z);
        extremes.push_back(
            *std::max_element(corners.begin(), corners.end(),
                              [&](const Vec3& a, const Vec3& b) { return a.dot(d) < b.dot(d); }));
      }
    }
  }
  const PointBlocks blocks(corners);
  for (const Blocker& blocker : blockers) {
    const Plane plane = PlaneOf(blocker.corner);
    if (light_from_afar || !HasAllOnOneSide(plane, extremes) || !blocks.HaveAllOnOneSide(plane)) {
      triangles_.push_back(blocker.corner);
    }
  }
  if (!triangles_.empty()) {
    Build(0, static_cast<Index>(triangles_.size()));
  }
}

void Occluders::Build(Index begin, Index end) {
  constexpr Index kLeafSize = 4;
  const auto self = static_cast<Index>(nodes_.size());
  Node node;
  Eigen::AlignedBox3d centroids;
  for (Index t = begin; t < end; ++t) {
    const Eigen::AlignedBox3d box = BoxOf(triangles_[t]);
    node.box.extend(box);
    centroids.extend(box.center());
  }
  node.begin = begin;
  node.end = end;
  nodes_.push_back(node);
  if (end - begin <= kLeafSize) {
    return;
  }
  Eigen::Index axis = 0;
  centroids.sizes().maxCoeff(&axis);
  const Index middle = begin + (end - begin) / 2;
  std::nth_element(
      triangles_.begin() + begin, triangles_.begin() + middle, triangles_.begin() + end,
      [axis](const auto& a, const auto& b) { return BoxOf(a).center()[axis] < BoxOf(b).center()[axis]; });
  Build(begin, middle);
  nodes_[self].right = static_cast<Index>(nodes_.size());
  Build(middle, end);
}

bool Occluders::Clear(const Polygon& a, const Polygon& b) const {
  if (triangles_.empty()) {
    return true;
  }
  const Shaft shaft(a, b);
  std::array<Index, 64> stack;
  std::size_t depth = 0;
  stack[depth++] = 0;
  while (depth > 0) {
    const Index at = stack[--depth];
    const Node& node = nodes_[at];
    if (!shaft.MayMeet(node.box)) {
      continue;
    }
    if (node.right != kNone) {
      stack[depth++] = node.right;
      stack[depth++] = at + 1;
      continue;
    }
    for (Index t = node.begin; t < node.end; ++t) {
      if (shaft.MayBlock(triangles_[t])) {
        return false;
      }
    }
  }
  return true;
}

}  // namespace radbake
