#include "solver/check/sky.h"

#include <oneapi/tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "solver/check/sample_points.h"

namespace radbake {
namespace {

constexpr Index kCellsAside = 48;
constexpr Index kCells = 6 * kCellsAside * kCellsAside;
constexpr std::uint32_t kRays = 8;  // to try a cell
constexpr double kLeast = 1e-4;     // what of a cell that no ray met is taken to be seen

// Off the walls, or a shadow ray would end in their planes and not be blocked; and no box is flat, or its
// cells would lie just above the ground.
constexpr double kMargin = 0.01;
constexpr double kThinnest = 0.25;

/// Places by area on the sides that reflect.
class Places {
 public:
  explicit Places(const TracedScene& scene) : scene_(scene) {
    double area = 0;
    for (Index i = 0; i < scene.facets.size(); ++i) {
      if (scene.facets[i].front && scene.facets[i].area > 0) {
        area += scene.facets[i].area;
        facets_.push_back(i);
        cumulative_.push_back(area);
      }
    }
  }

  bool empty() const { return facets_.empty(); }

  Place Draw(double u, std::array<double, 2> sample, bool back) const {
    const auto found =
        std::ranges::upper_bound(cumulative_.begin(), cumulative_.end() - 1, u * cumulative_.back());
    const Index facet = facets_[static_cast<std::size_t>(found - cumulative_.begin())];
    const Vec3& normal = scene_.facets[facet].normal;
    return {.point = PointOf(scene_.corners[facet], sample),
            .normal = back && scene_.facets[facet].back ? Vec3(-normal) : normal};
  }

 private:
  const TracedScene& scene_;
  std::vector<Index> facets_;
  std::vector<double> cumulative_;
};

/// What to take a cell's visible share for: few rays miss a small part of an opening, so a cell beside a
/// visible one is likely to be visible too.
double ShareOf(const std::vector<double>& seen, Index cell) {
  constexpr double kBeside = 0.25;
  const auto signed_cell = static_cast<int>(cell);
  constexpr int kSide = kCellsAside;
  const int column = signed_cell % kSide;
  const int row = signed_cell / kSide % kSide;
  double share = std::max(seen[cell], kLeast);
  for (int i = std::max(row - 1, 0); i <= std::min(row + 1, kSide - 1); ++i) {
    for (int j = std::max(column - 1, 0); j <= std::min(column + 1, kSide - 1); ++j) {
      const int beside = signed_cell + (i - row) * kSide + (j - column);
      share = std::max(share, kBeside * seen[static_cast<std::size_t>(beside)]);
    }
  }
  return share;
}

Vec3 HalfSizes(const TracedScene& scene) {
  Eigen::AlignedBox3d box;
  for (const Corners& corners : scene.corners) {
    for (const Vec3& corner : corners) {
      box.extend(corner);
    }
  }
  const Vec3 half = box.min().cwiseAbs().cwiseMax(box.max().cwiseAbs());
  return (half.array() + kMargin).max(kThinnest / 2);
}

}  // namespace

Sky::Cell Sky::CellOf(const Vec3& half, Index index) {
  const Index face = index / (kCellsAside * kCellsAside);
  const auto axis = static_cast<Eigen::Index>(face / 2);
  const double side = face % 2 == 0 ? -1 : 1;
  const Eigen::Index across = (axis + 1) % 3;
  const Eigen::Index along = (axis + 2) % 3;
  Cell cell{.corner = Vec3::Zero(), .u = Vec3::Zero(), .v = Vec3::Zero(), .normal = Vec3::Zero()};
  cell.u[across] = 2 * half[across] / kCellsAside;
  cell.v[along] = 2 * half[along] / kCellsAside;
  cell.normal[axis] = -side;
  cell.corner[axis] = side * half[axis];
  cell.corner[across] = -half[across] + index % kCellsAside * cell.u[across];
  cell.corner[along] = -half[along] + index / kCellsAside % kCellsAside * cell.v[along];
  return cell;
}

Sky::Sky(const TracedScene& scene, const RayCaster& caster) : half_(HalfSizes(scene)) {
  const Places places(scene);
  if (!(scene.environment > 0).any() || places.empty()) {
    return;
  }
  std::vector<double> seen(kCells);
  tbb::parallel_for(Index{0}, kCells, [&](Index i) {
    const Cell cell = CellOf(half_, i);
    const SamplePoints points(SubStream(Scramble(kCells), i));
    double aimed = 0;
    for (std::uint32_t ray = 0; ray < kRays; ++ray) {
      const auto [a, b] = points.Point(ray, 0);
      const auto [c, back] = points.Point(ray, 2);
      const Vec3 target = cell.corner + a * cell.u + b * cell.v;
      const Place place = places.Draw(c, points.Point(ray, 1), back < 0.5);
      if (place.normal.dot(target - place.point) > 0) {
        aimed += 1;
        seen[i] += caster.Occluded(place.point, target) ? 0 : 1;
      }
    }
    seen[i] /= std::max(aimed, 1.0);
  });
  if (std::ranges::all_of(seen, [](double share) { return share == 0; })) {
    return;
  }
  std::vector<LightTree::Lamp> lamps;
  for (Index i = 0; i < kCells; ++i) {
    const Cell cell = CellOf(half_, i);
    lamps.push_back({.centre = cell.corner + (cell.u + cell.v) / 2,
                     .radius = (cell.u + cell.v).norm() / 2,
                     .weight = cell.u.norm() * cell.v.norm() * ShareOf(seen, i),
                     .axis = cell.normal,
                     .cosine = 0});
  }
  tree_.emplace(lamps);
}

std::optional<Sky::Point> Sky::Draw(const Place& place, std::array<double, 2> sample) const {
  const auto choice = tree_ ? tree_->Choose(place, sample[0]) : std::nullopt;
  if (!choice) {
    return std::nullopt;
  }
  const Cell cell = CellOf(half_, choice->lamp);
  return Point{.point = cell.corner + choice->rest * cell.u + sample[1] * cell.v,
               .normal = cell.normal,
               .density = choice->probability / (cell.u.norm() * cell.v.norm())};
}

Sky::Point Sky::Exit(const Place& place, const Vec3& direction) const {
  double distance = std::numeric_limits<double>::infinity();
  Eigen::Index axis = 0;
  for (Eigen::Index i = 0; i < 3; ++i) {
    if (direction[i] != 0) {
      const double to_side = (std::copysign(half_[i], direction[i]) - place.point[i]) / direction[i];
      if (to_side < distance) {
        distance = to_side;
        axis = i;
      }
    }
  }
  Point exit{.point = place.point + distance * direction, .normal = Vec3::Zero(), .density = 0};
  exit.normal[axis] = direction[axis] > 0 ? -1 : 1;
  if (tree_) {
    const auto cell_along = [&](Eigen::Index i) {
      const double cells = (exit.point[i] / half_[i] + 1) / 2 * kCellsAside;
      return std::min(static_cast<Index>(std::max(cells, 0.0)), kCellsAside - 1);
    };
    const Index face = 2 * static_cast<Index>(axis) + (direction[axis] > 0 ? 1U : 0U);
    const Index cell =
        (face * kCellsAside + cell_along((axis + 2) % 3)) * kCellsAside + cell_along((axis + 1) % 3);
    const Cell sides = CellOf(half_, cell);
    exit.density = tree_->Probability(cell, place) / (sides.u.norm() * sides.v.norm());
  }
  return exit;
}

}  // namespace radbake
