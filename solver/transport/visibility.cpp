#include "solver/transport/visibility.h"

#include <algorithm>
#include <array>
#include <numbers>
#include <span>

namespace radbake {
namespace {

std::vector<Corners> TrianglesOf(const Patches& patches) {
  std::vector<Corners> triangles;
  triangles.reserve(patches.blockers.size());
  for (const Blocker& blocker : patches.blockers) {
    triangles.push_back(blocker.corner);
  }
  return triangles;
}

std::vector<Polygon> FacesOf(const Patches& patches) {
  std::vector<Polygon> faces(patches.surface_patches);
  for (Index p = 0; p < faces.size(); ++p) {
    const Patch& patch = patches.patches[p];
    faces[p].count = patch.corner_count;
    faces[p].normal = patch.normal;
    std::ranges::copy(patch.corner, faces[p].corner.begin());
  }
  return faces;
}

std::vector<double> EmissionOf(const Patches& patches) {
  std::vector<double> emission(patches.surface_patches);
  std::ranges::transform(std::span(patches.patches).first(emission.size()), emission.begin(),
                         [](const Patch& patch) { return Luminance(patch.emission); });
  return emission;
}

/// cos θ_y / r³, so that times (y − x)·n_x it is cos θ_x·cos θ_y / r².
double Kernel(const Vec3& x, const Vec3& y, const Vec3& normal_y) {
  const double r2 = (y - x).squaredNorm();
  return r2 > 0 ? std::max(0.0, (x - y).dot(normal_y)) / (r2 * r2) : 0;
}

/// Do the boxes of the two polygons come closer than a small part of their size?
bool Touching(const Polygon& a, const Polygon& b) {
  Eigen::AlignedBox3d box_a;
  Eigen::AlignedBox3d box_b;
  for (int k = 0; k < a.count; ++k) {
    box_a.extend(a[k]);
  }
  for (int k = 0; k < b.count; ++k) {
    box_b.extend(b[k]);
  }
  constexpr double kClose = 0.1;
  return box_a.exteriorDistance(box_b) <
         kClose * std::min(box_a.sizes().maxCoeff(), box_b.sizes().maxCoeff());
}

}  // namespace

Visibility::Visibility(const Patches& patches)
    : caster_(TrianglesOf(patches)),
      occluders_(patches),
      overlaps_(FacesOf(patches), EmissionOf(patches), RayCaster::kPlaneTolerance) {
  for (const Blocker& blocker : patches.blockers) {
    dead_.push_back({blocker.front == kNone, blocker.back == kNone});
    any_dead_ = any_dead_ || blocker.front == kNone || blocker.back == kNone;
  }
}

bool Visibility::SeesNothingLit(const Vec3& y, const Vec3& direction) const {
  const auto hit = caster_.Closest(y, direction);
  return hit && (hit->front ? dead_[hit->triangle].front : dead_[hit->triangle].back);
}

bool Visibility::IsSealed(const Vec3& y, const Polygon& polygon, std::uint64_t& rays) const {
  if (Covered(y, polygon.patch)) {
    return true;
  }
  if (!any_dead_ || occluders_.empty()) {
    return false;
  }
  // Up, then around at 60 degrees from the normal.
  const Vec3& normal = polygon.normal;
  const Vec3 tangent = normal.unitOrthogonal();
  const Vec3 bitangent = normal.cross(tangent);
  constexpr double kSine = 0.8660254037844386;
  const std::array<Vec3, 5> directions = {normal, 0.5 * normal + kSine * tangent,
                                          0.5 * normal - kSine * tangent, 0.5 * normal + kSine * bitangent,
                                          0.5 * normal - kSine * bitangent};
  return std::ranges::all_of(directions, [&](const Vec3& direction) {
    ++rays;
    return SeesNothingLit(y, direction);
  });
}

double Visibility::OpenShare(const Polygon& polygon, std::uint64_t key, int points) const {
  QuasiRandom<2> random(key);
  int open = 0;
  int seen = 0;
  RayBatch batch(*this);
  const PointsOn points_on(polygon);
  const int first = std::max(1, points / 8);
  for (; seen < points && (seen < first || (open > 0 && open < seen)); ++seen) {
    const auto u = random.Next();
    open += IsSealed(points_on(u[0], u[1]), polygon, batch.rays) ? 0 : 1;
  }
  return static_cast<double>(open) / seen;
}

SampledVisibility Visibility::BetweenElements(const Polygon& a, const Polygon& b, double exchange_area,
                                              std::uint64_t key, int rays) const {
  RaysBetween between(*this, a, b);
  if (between.empty()) {
    return {0, 0};
  }
  // Two halves of the rays, each a sum of kernel weights over all rays and over the open ones. Each has a
  // sequence of its own: of one that both shared, the second half would find what the first has missed.
  std::array<QuasiRandom<4>, 2> random = {QuasiRandom<4>(key), QuasiRandom<4>(Hash(key))};
  std::array<double, 2> all{};
  std::array<double, 2> open{};
  for (int k = 0; k < rays; ++k) {
    const std::size_t half = static_cast<std::size_t>(k) % 2;
    const RaysBetween::Ray ray = between.Cast(random[half]);
    all[half] += ray.weight;
    open[half] += ray.open ? ray.weight : 0;
  }
  // The exact integral is a control variate: V = (open + c·(exact − all))/exact is unbiased for any c that
  // does not depend on the same rays. The best c is V itself, as the other rays see it; 1 where the polygons
  // touch, since there the kernel has a peak, without bound, that little fits in between and that few rays
  // find.
  SampledVisibility result;
  result.judged = all[0] > 0 ? open[0] / all[0] : 0;
  if (open[0] + open[1] > 0) {
    const double c = Touching(between.a(), between.b()) ? 1 : result.judged;
    const double share =
        Area(between.a()) * Area(between.b()) / (std::numbers::pi * exchange_area * (0.5 * rays));
    // Above 1 by chance: cut there, what is hardly hidden would carry too little in the mean.
    constexpr double kMost = 2;
    result.carried = std::clamp(share * open[1] + c * (1 - share * all[1]), 0.0, kMost);
  }
  return result;
}

double Visibility::FromPoint(const Vec3& x, const Vec3& n, const Polygon& polygon, QuasiRandom<2>& random,
                             int rays) const {
  const Polygon front = ClipToFront(polygon, {n, n.dot(x)});
  if (front.count == 0) {
    return 0;
  }
  double open = 0;
  double all = 0;
  RayBatch batch(*this);
  const PointsOn on_front(front);
  for (int k = 0; k < rays; ++k) {
    const auto u = random.Next();
    const Vec3 y = on_front(u[0], u[1]);
    const double weight = std::max(0.0, (y - x).dot(n)) * Kernel(x, y, polygon.normal);
    ++batch.rays;
    all += weight;
    open += Blocked(x, kNone, y, polygon.patch) ? 0 : weight;
  }
  return all > 0 ? open / all : 0;
}

RaysBetween::RaysBetween(const Visibility& visibility, const Polygon& a, const Polygon& b)
    : visibility_(visibility),
      front_a_(ClipToFront(a, PlaneOf(b))),
      front_b_(ClipToFront(b, PlaneOf(a))),
      on_a_(front_a_),
      on_b_(front_b_),
      batch_(visibility) {}

RaysBetween::Ray RaysBetween::Cast(QuasiRandom<4>& random) {
  const auto u = random.Next();
  const Vec3 x = on_a_(u[0], u[1]);
  const Vec3 y = on_b_(u[2], u[3]);
  ++batch_.rays;
  return {y, std::max(0.0, (y - x).dot(front_a_.normal)) * Kernel(x, y, front_b_.normal),
          !visibility_.Blocked(x, front_a_.patch, y, front_b_.patch)};
}

RayCount Visibility::Counted() const {
  return {rays_.load(), caster_.Seconds()};
}

void Visibility::Count(std::uint64_t rays) const {
  rays_.fetch_add(rays, std::memory_order_relaxed);
}

}  // namespace radbake
