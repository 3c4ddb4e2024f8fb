#include "solver/transport/visibility.h"

#include <chrono>
#include <vector>

#include "solver/transport/sampling.h"

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
  int open = 0;
  Batch batch(*this);
  for (int k = 0; k < rays; ++k) {
    const auto u = random.Next();
    ++batch.rays;
    open += caster_.Occluded(PointOn(front_a, u[0], u[1]), PointOn(front_b, u[2], u[3])) ? 0 : 1;
  }
  return static_cast<double>(open) / rays;
}

double Visibility::FromPoint(const Vec3& x, const Vec3& n, const Polygon& polygon, std::uint64_t key,
                             int rays) const {
  const Polygon front = ClipToFront(polygon, {n, n.dot(x)});
  if (front.count == 0) {
    return 0;
  }
  QuasiRandom<2> random(key);
  int open = 0;
  int cast = 0;
  Batch batch(*this);
  const int first = std::max(1, rays / 4);
  for (; cast < rays && (cast < first || (open > 0 && open < cast)); ++cast) {
    const auto u = random.Next();
    ++batch.rays;
    open += caster_.Occluded(x, PointOn(front, u[0], u[1])) ? 0 : 1;
  }
  return static_cast<double>(open) / cast;
}

RayCount Visibility::Counted() const {
  return {rays_.load(), static_cast<double>(nanoseconds_.load()) * 1e-9};
}

void Visibility::Count(std::uint64_t rays, double seconds) const {
  rays_.fetch_add(rays, std::memory_order_relaxed);
  nanoseconds_.fetch_add(static_cast<std::uint64_t>(seconds * 1e9), std::memory_order_relaxed);
}

}  // namespace radbake
