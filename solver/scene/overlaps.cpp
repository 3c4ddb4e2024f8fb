#include "solver/scene/overlaps.h"

#include <algorithm>
#include <cstddef>
#include <utility>

namespace radbake {
namespace {

/// The plane through an edge of a face, upright on it, whose front is the face's side.
Plane EdgePlane(const Polygon& face, int k) {
  const Vec3& a = face[k];
  const Vec3 inwards = face.normal.cross(face[(k + 1) % face.count] - a).normalized();
  return {inwards, inwards.dot(a)};
}

/// In one plane, looking the same way, and with more than an edge in common?
bool Overlap(const Polygon& a, const Polygon& b, double tolerance) {
  if (a.normal.dot(b.normal) <= 0) {
    return false;
  }
  // The larger one's plane is the better known.
  const bool a_larger = Area(a) > Area(b);
  const Plane plane = PlaneOf(a_larger ? a : b);
  Polygon common = a_larger ? b : a;
  for (int k = 0; k < common.count; ++k) {
    if (std::abs(plane.Distance(common[k])) > tolerance) {
      return false;
    }
  }
  const Polygon& other = a_larger ? a : b;
  for (int k = 0; k < other.count && common.count > 0; ++k) {
    Plane edge = EdgePlane(other, k);
    edge.offset += 2 * tolerance;
    common = ClipToFront(common, edge);
  }
  return common.count > 0 && Area(common) > tolerance * tolerance;
}

/// Faces whose boxes meet, by halving space until few are left.
class Search {
 public:
  template <typename Visit>
  Search(std::span<const Polygon> faces, double tolerance, const Visit& visit) {
    Eigen::AlignedBox3d all;
    for (const Polygon& face : faces) {
      Eigen::AlignedBox3d box;
      for (int k = 0; k < face.count; ++k) {
        box.extend(face[k]);
      }
      if (face.count > 0) {
        boxes_.emplace_back(Vec3(box.min().array() - tolerance), Vec3(box.max().array() + tolerance));
        all.extend(boxes_.back());
      } else {
        boxes_.emplace_back();
      }
    }
    std::vector<Index> present;
    for (Index i = 0; i < faces.size(); ++i) {
      if (faces[i].count > 0) {
        present.push_back(i);
      }
    }
    Divide(std::move(present), all, visit);
  }

 private:
  template <typename Visit>
  void Divide(std::vector<Index> within, const Eigen::AlignedBox3d& space, const Visit& visit) const {
    constexpr std::size_t kFew = 16;
    if (within.size() > kFew) {
      Eigen::Index axis = 0;
      space.sizes().maxCoeff(&axis);
      std::array<Eigen::AlignedBox3d, 2> halves = {space, space};
      halves[0].max()[axis] = halves[1].min()[axis] = space.center()[axis];
      std::array<std::vector<Index>, 2> parts;
      for (const Index i : within) {
        for (std::size_t h = 0; h < 2; ++h) {
          if (halves[h].intersects(boxes_[i])) {
            parts[h].push_back(i);
          }
        }
      }
      // As long as the halves are worth the faces that lie in both.
      if (parts[0].size() + parts[1].size() < within.size() + within.size() / 2) {
        within = {};
        Divide(std::move(parts[0]), halves[0], visit);
        Divide(std::move(parts[1]), halves[1], visit);
        return;
      }
    }
    for (std::size_t i = 0; i < within.size(); ++i) {
      for (std::size_t j = i + 1; j < within.size(); ++j) {
        if (boxes_[within[i]].intersects(boxes_[within[j]])) {
          visit(within[i], within[j]);
        }
      }
    }
  }

  std::vector<Eigen::AlignedBox3d> boxes_;
};

}  // namespace

Overlaps::Overlaps(std::span<const Polygon> faces, std::span<const double> emission, double tolerance) {
  const auto before = [&](Index a, Index b) {
    return emission[a] != emission[b] ? emission[a] > emission[b] : a < b;
  };
  const Search search(faces, tolerance, [&](Index a, Index b) {
    if (Overlap(faces[a], faces[b], tolerance)) {
      covers_.push_back(before(a, b) ? Pair{.under = b, .over = a} : Pair{.under = a, .over = b});
    }
  });
  std::ranges::sort(covers_, [&](const Pair& a, const Pair& b) {
    return a.under != b.under ? a.under < b.under : before(a.over, b.over);
  });
  const auto repeated = std::ranges::unique(covers_);
  covers_.erase(repeated.begin(), repeated.end());
  for (const Pair& pair : covers_) {
    over_.push_back(faces[pair.over]);
  }
}

std::span<const Overlaps::Pair> Overlaps::operator[](Index face) const {
  const auto [begin, end] = std::ranges::equal_range(covers_, face, {}, &Pair::under);
  return {begin, end};
}

Index Overlaps::At(Index face, const Vec3& x) const {
  const std::span<const Pair> pairs = (*this)[face];
  const auto first = std::ranges::find_if(pairs, [&](const Pair& pair) {
    const Polygon& over = over_[static_cast<std::size_t>(&pair - covers_.data())];
    for (int k = 0; k < over.count; ++k) {
      if (EdgePlane(over, k).Distance(x) <= 0) {
        return false;
      }
    }
    return true;
  });
  return first == pairs.end() ? face : first->over;
}

}  // namespace radbake
