#include "solver/transport/visibility.h"

#include <algorithm>
#include <chrono>
#include <vector>

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

/// cos θ_y / r³, so that times (y − x)·n_x it is cos θ_x·cos θ_y / r².
double Kernel(const Vec3& x, const Vec3& y, const Vec3& normal_y) {
  const double r2 = (y - x).squaredNorm();
  return r2 > 0 ? std::max(0.0, (x - y).dot(normal_y)) / (r2 * r2) : 0;
}

/// Times one batch of rays.
class Batch {
 public:
  explicit Batch(const Visibility& visibility) : visibility_(visibility) {}
  ~Batch() {
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - start_;
    visibility_.Count(rays, spent.count());
  }
  Batch(const Batch&) = delete;
  Batch& operator=(const Batch&) = delete;
  std::uint64_t rays = 0;

 private:
  const Visibility& visibility_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace

Visibility::Visibility(const Patches& patches)
    : caster_(TrianglesOf(patches)), occluders_(patches.blockers) {}

double Visibility::BetweenElements(const Polygon& a, const Polygon& b, std::uint64_t key, int rays) const {
  const Polygon front_a = ClipToFront(a, PlaneOf(b));
  const Polygon front_b = ClipToFront(b, PlaneOf(a));
  if (front_a.count == 0 || front_b.count == 0) {
    return 0;
  }
  QuasiRandom<4> random(key);
  double open = 0;
  double all = 0;
  Batch batch(*this);
  for (int k = 0; k < rays; ++k) {
    const auto u = random.Next();
    const Vec3 x = PointOn(front_a, u[0], u[1]);
    const Vec3 y = PointOn(front_b, u[2], u[3]);
    const double weight = std::max(0.0, (y - x).dot(a.normal)) * Kernel(x, y, b.normal);
    ++batch.rays;
    all += weight;
    open += caster_.Occluded(x, y) ? 0 : weight;
  }
  return all > 0 ? open / all : 0;
}

double Visibility::FromPoint(const Vec3& x, const Vec3& n, const Polygon& polygon, QuasiRandom<2>& random,
                             int rays) const {
  const Polygon front = ClipToFront(polygon, {n, n.dot(x)});
  if (front.count == 0) {
    return 0;
  }
  double open = 0;
  double all = 0;
  Batch batch(*this);
  const int first = std::max(1, rays / 4);
  for (int cast = 0; cast < rays && (cast < first || (open > 0 && open < all)); ++cast) {
    const auto u = random.Next();
    const Vec3 y = PointOn(front, u[0], u[1]);
    const double weight = std::max(0.0, (y - x).dot(n)) * Kernel(x, y, polygon.normal);
    ++batch.rays;
    all += weight;
    open += caster_.Occluded(x, y) ? 0 : weight;
  }
  return all > 0 ? open / all : 0;
}

RayCount Visibility::Counted() const {
  return {rays_.load(), static_cast<double>(nanoseconds_.load()) * 1e-9};
}

void Visibility::Count(std::uint64_t rays, double seconds) const {
  rays_.fetch_add(rays, std::memory_order_relaxed);
  nanoseconds_.fetch_add(static_cast<std::uint64_t>(seconds * 1e9), std::memory_order_relaxed);
}

}  // namespace radbake
