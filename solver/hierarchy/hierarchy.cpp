#include "solver/hierarchy/hierarchy.h"

#include <algorithm>
#include <cmath>

#include "solver/scene/bytes.h"

namespace radbake {
namespace {

// Corners of neighbouring patches belong to one smooth surface if their shading normals are this close
// (1.8°).
constexpr double kSmoothCosine = 0.9995;

std::uint64_t PairKey(Index a, Index b) {
  return (static_cast<std::uint64_t>(std::min(a, b)) << 32U) | std::max(a, b);
}

/// Finds points that coincide within a tolerance, by a hash of grid cells twice that size.
class Welder {
 public:
  explicit Welder(double tolerance) : tolerance_(tolerance) {}

  /// The index that an equal point was given before, or `fresh`, which the point then keeps.
  Index Find(const Vec3& point, Index fresh) {
    const double cell = 2 * tolerance_;
    const Vec3 low = (point.array() - tolerance_) / cell;
    const Vec3 high = (point.array() + tolerance_) / cell;
    for (double x = std::floor(low[0]); x <= std::floor(high[0]); ++x) {
      for (double y = std::floor(low[1]); y <= std::floor(high[1]); ++y) {
        for (double z = std::floor(low[2]); z <= std::floor(high[2]); ++z) {
          const auto [begin, end] = cells_.equal_range(Key(x, y, z));
          for (auto at = begin; at != end; ++at) {
            if ((at->second.first - point).cwiseAbs().maxCoeff() <= tolerance_) {
              return at->second.second;
            }
          }
        }
      }
    }
    cells_.emplace(Key(std::floor(point[0] / cell), std::floor(point[1] / cell), std::floor(point[2] / cell)),
                   std::make_pair(point, fresh));
    return fresh;
  }

 private:
  static std::uint64_t Key(double x, double y, double z) {
    const auto part = [](double v) { return static_cast<std::uint64_t>(static_cast<std::int64_t>(v)); };
    return part(x) * 0x9E3779B97F4A7C15U ^ part(y) * 0xC2B2AE3D27D4EB4FU ^ part(z) * 0x165667B19E3779F9U;
  }

  double tolerance_;
  std::unordered_multimap<std::uint64_t, std::pair<Vec3, Index>> cells_;
};

}  // namespace

Hierarchy::Hierarchy(const Patches& patches, bool clustering)
    : patches_(patches), clusters_(clustering ? Clusters(patches) : Clusters()) {
  elements_.reserve(patches.patches.size() * 4);
  for (Index p = 0; p < patches.patches.size(); ++p) {
    Element root;
    root.patch = p;
    root.area = patches.patches[p].area;
    elements_.push_back(root);
  }
  WeldCorners();
}

void Hierarchy::WeldCorners() {
  Welder welder(patches_.weld);
  struct Known {
    Index vertex;
    Vec3 shading_normal;
    Vec3 normal;
  };
  std::vector<std::vector<Known>> vertices_at;
  for (Element& root : elements_) {
    const Patch& patch = patches_.patches[root.patch];
    for (std::size_t k = 0; k < static_cast<std::size_t>(patch.corner_count); ++k) {
      const Index position = welder.Find(patch.corner[k], static_cast<Index>(positions_.size()));
      if (position == positions_.size()) {
        AddPosition(patch.corner[k]);
        vertices_at.emplace_back();
      }
      const auto same_surface = [&](const Known& known) {
        return known.shading_normal.dot(patch.shading_normal[k]) > kSmoothCosine &&
               known.normal.dot(patch.normal) > 0;
      };
      auto& known = vertices_at[position];
      const auto found = std::find_if(known.begin(), known.end(), same_surface);
      if (found != known.end()) {
        root.corner[k] = found->vertex;
      } else {
        root.corner[k] = AddVertex(position);
        known.push_back({root.corner[k], patch.shading_normal[k], patch.normal});
      }
    }
  }
}

Index Hierarchy::AddPosition(const Vec3& point) {
  positions_.push_back(point);
  return static_cast<Index>(positions_.size() - 1);
}

Index Hierarchy::AddVertex(Index position) {
  position_of_.push_back(position);
  return static_cast<Index>(position_of_.size() - 1);
}

Polygon Hierarchy::Shape(Index element) const {
  const Element& e = elements_[element];
  Polygon polygon;
  polygon.count = e.CornerCount();
  polygon.normal = PatchOf(element).normal;
  polygon.patch = e.patch;
  for (int k = 0; k < polygon.count; ++k) {
    polygon[k] = Point(e.corner[static_cast<std::size_t>(k)]);
  }
  return polygon;
}

double Hierarchy::Area(Index node) const {
  return IsCluster(node) ? clusters_[node - kFirstCluster].area : elements_[node].area;
}

Vec3 Hierarchy::Centre(Index node) const {
  return IsCluster(node) ? clusters_[node - kFirstCluster].centre : Shape(node).Centroid();
}

double Hierarchy::Radius(Index node) const {
  if (IsCluster(node)) {
    return clusters_[node - kFirstCluster].radius;
  }
  const Polygon shape = Shape(node);
  const Vec3 centre = shape.Centroid();
  double radius = 0;
  for (int k = 0; k < shape.count; ++k) {
    radius = std::max(radius, (shape[k] - centre).norm());
  }
  return radius;
}

Index Hierarchy::FindMidpoint(Index position_a, Index position_b) const {
  const auto found = mid_position_.find(PairKey(position_a, position_b));
  return found == mid_position_.end() ? kNone : found->second;
}

Index Hierarchy::MidVertex(Index vertex_a, Index vertex_b) {
  const auto [at, is_new] = mid_vertex_.try_emplace(PairKey(vertex_a, vertex_b), kNone);
  if (is_new) {
    const Index a = position_of_[vertex_a];
    const Index b = position_of_[vertex_b];
    const auto [position, is_new_position] = mid_position_.try_emplace(PairKey(a, b), kNone);
    if (is_new_position) {
      position->second = AddPosition(0.5 * (positions_[a] + positions_[b]));
    }
    at->second = AddVertex(position->second);
  }
  return at->second;
}

std::size_t Hierarchy::Bytes() const {
  return BytesOf(elements_) + BytesOf(positions_) + BytesOf(position_of_) + BytesOf(mid_position_) +
         BytesOf(mid_vertex_);
}

Index Hierarchy::AddChild(Index parent, const std::array<Index, 4>& corner) {
  Element child;
  child.corner = corner;
  child.patch = elements_[parent].patch;
  child.parent = parent;
  elements_.push_back(child);
  const auto index = static_cast<Index>(elements_.size() - 1);
  elements_[index].area = radbake::Area(Shape(index));
  return index;
}

Division Hierarchy::HowToDivide(Index element) const {
  if (elements_[element].CornerCount() == 3) {
    return Division::kTriangle;
  }
  const Polygon shape = Shape(element);
  const double along_01 = (shape[1] - shape[0]).norm() + (shape[2] - shape[3]).norm();
  const double along_12 = (shape[2] - shape[1]).norm() + (shape[3] - shape[0]).norm();
  // From twice as long on, four in a row are no longer than the parent's quarters; and no round number, or
  // rounding would decide.
  constexpr double kLong = 2.6;
  return along_01 > kLong * along_12   ? Division::kAlong01
         : along_12 > kLong * along_01 ? Division::kAlong12
                                       : Division::kSquare;
}

Index Hierarchy::Divide(Index element) {
  if (!elements_[element].IsLeaf()) {
    return elements_[element].first_child;
  }
  const auto first = static_cast<Index>(elements_.size());
  const Division division = HowToDivide(element);
  const auto children = CornersOfChildren(
      division, elements_[element].corner, [this](Index a, Index b) { return MidVertex(a, b); }, kNone);
  for (const std::array<Index, 4>& corner : children) {
    AddChild(element, corner);
  }
  elements_[element].first_child = first;
  elements_[element].division = division;
  return first;
}

Index Hierarchy::ChildAt(Index element, const Vec3& x) const {
  const Element& e = elements_[element];
  std::array<Vec3, 4> corner;
  for (std::size_t k = 0; k < static_cast<std::size_t>(e.CornerCount()); ++k) {
    corner[k] = Point(e.corner[k]);
  }
  return e.first_child + radbake::ChildAt(e.division, corner, PatchOf(element).normal, x);
}

}  // namespace radbake
