// What transport costs one by one, and whether it is right: form factors against Howell's catalogue, rays
// against a segment-triangle test in double, shafts against the cross-section of a shaft of two squares.
#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

#include "solver/transport/form_factor.h"
#include "solver/transport/ray_caster.h"
#include "solver/transport/sampling.h"
#include "solver/transport/seen_polygon.h"
#include "solver/transport/shaft.h"
#include "tests/bench/bench.h"

namespace radbake::bench {
namespace {

using std::numbers::pi;

constexpr double kTolerance = 1e-6;

/// The square with corner `low` and sides along x and y, its front upwards or downwards.
Polygon Square(const Vec3& low, double side, bool up) {
  Polygon square;
  square.count = 4;
  square[0] = low;
  square[1] = low + (up ? Vec3(side, 0, 0) : Vec3(0, side, 0));
  square[2] = low + Vec3(side, side, 0);
  square[3] = low + (up ? Vec3(0, side, 0) : Vec3(side, 0, 0));
  square.normal = up ? Vec3::UnitZ() : Vec3(-Vec3::UnitZ());
  return square;
}

const Polygon& Floor() {
  static const Polygon kFloor = Square(Vec3::Zero(), 1, true);
  return kFloor;
}

/// Howell C-11: unit squares, parallel, directly opposed, at distance 1/x.
double OpposedSquares(double x) {
  const double x2 = 1 + x * x;
  const double root = std::sqrt(x2);
  return 2 / (pi * x * x) *
         (std::log(root * std::sqrt(x2 / (x2 + x * x))) + 2 * x * root * std::atan(x / root) -
          2 * x * std::atan(x));
}

/// Howell C-14 for unit squares with a common edge at a right angle.
double PerpendicularSquares() {
  const double root = std::numbers::sqrt2;
  return (0.5 * pi - root * std::atan(1 / root) + 0.25 * std::log(0.75)) / pi;
}

/// Howell B-4: from a point to the unit square that has a corner straight above it, 1 away.
double CornerSquare() {
  const double root = std::numbers::sqrt2;
  return std::atan(1 / root) / (pi * root);
}

void BenchFormFactor(benchmark::State& state, const std::function<double()>& compute, double expected) {
  double computed = 0;
  while (state.KeepRunning()) {
    computed = compute();
    benchmark::DoNotOptimize(computed);
  }
  const double error = std::abs(computed / expected - 1);
  state.counters["error"] = error;
  if (!(error <= kTolerance)) {
    Fail(state, "the form factor is " + std::to_string(computed) + ", not " + std::to_string(expected));
  }
}

struct Segment {
  Vec3 a;
  Vec3 b;
};

enum class Meeting { kMiss, kHit, kTooCloseToTell };

/// Where a segment crosses a triangle's plane, and how far inside of the nearest edge.
Meeting Meet(const Segment& segment, const Corners& corners) {
  constexpr double kMargin = 1e-5;
  const Vec3 normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalized();
  const double from = normal.dot(segment.a - corners[0]);
  const double to = normal.dot(segment.b - corners[0]);
  // An end on the triangle's own plane is not blocked by it: such ends are exact here.
  if (from * to >= 0 || std::min(std::abs(from), std::abs(to)) < 1e-12) {
    return Meeting::kMiss;
  }
  const Vec3 at = segment.a + from / (from - to) * (segment.b - segment.a);
  double inside = INFINITY;
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3 edge = (corners[(k + 1) % 3] - corners[k]).normalized();
    inside = std::min(inside, normal.cross(edge).dot(at - corners[k]));
  }
  const bool clear_ends = std::min(std::abs(from), std::abs(to)) > kMargin;
  if (inside < -kMargin) {
    return Meeting::kMiss;
  }
  return inside > kMargin && clear_ends ? Meeting::kHit : Meeting::kTooCloseToTell;
}

/// Rays between points of random facing patches of the scene.
void BenchShadowRay(benchmark::State& state, const std::string& scene) {
  const Patches patches = LoadPatches(scene);
  std::vector<Corners> triangles;
  triangles.reserve(patches.blockers.size());
  for (const Blocker& blocker : patches.blockers) {
    triangles.push_back(blocker.corner);
  }
  const RayCaster caster(triangles);

  constexpr std::size_t kRays = 4096;
  std::vector<Segment> segments;
  QuasiRandom<6> random(1);
  const auto point = [&](const Patch& patch, double u, double v) {
    Polygon polygon;
    polygon.count = patch.corner_count;
    std::copy_n(patch.corner.begin(), patch.corner_count, polygon.corner.begin());
    return PointOn(polygon, u, v);
  };
  while (segments.size() < kRays) {
    const auto u = random.Next();
    const auto pick = [&](double at) -> const Patch& {
      return patches.patches[static_cast<std::size_t>(at * static_cast<double>(patches.patches.size()))];
    };
    const Patch& from = pick(u[0]);
    const Patch& to = pick(u[1]);
    const Segment segment{.a = point(from, u[2], u[3]), .b = point(to, u[4], u[5])};
    const Vec3 way = segment.b - segment.a;
    if (way.dot(from.normal) > 0 && way.dot(to.normal) < 0) {
      segments.push_back(segment);
    }
  }

  std::size_t next = 0;
  while (state.KeepRunning()) {
    benchmark::DoNotOptimize(caster.Occluded(segments[next].a, segments[next].b));
    next = (next + 1) % kRays;
  }

  std::size_t blocked = 0;
  for (const Segment& segment : segments) {
    bool hit = false;
    bool sure = true;
    for (const Corners& corners : triangles) {
      const Meeting meeting = Meet(segment, corners);
      hit = hit || meeting == Meeting::kHit;
      sure = sure && meeting != Meeting::kTooCloseToTell;
    }
    if ((hit || sure) && hit != caster.Occluded(segment.a, segment.b)) {
      Fail(state, hit ? "a ray went through a triangle" : "a ray was blocked by nothing");
      return;
    }
    blocked += hit ? 1U : 0U;
  }
  state.counters["blocked%"] = 100 * static_cast<double>(blocked) / kRays;
}

/// A square blocker of side 0.25 half-way between unit squares 1 apart, and pairs of cells of 0.1 of these:
/// half-way, their shaft is a cell of 0.1 too, and it is clear exactly if that does not meet the blocker.
void BenchShaft(benchmark::State& state) {
  constexpr double kLow = 0.375;
  constexpr double kHigh = 0.625;
  constexpr double kCell = 0.1;
  Patches patches;
  for (const Polygon& square :
       {Square(Vec3::Zero(), 1, true), Square(Vec3(kLow, kLow, 0.5), kHigh - kLow, true),
        Square(Vec3(0, 0, 1), 1, false)}) {
    patches.blockers.push_back({.corner = {square[0], square[1], square[2]}});
    patches.blockers.push_back({.corner = {square[0], square[2], square[3]}});
  }
  const Occluders occluders(patches);

  struct Pair {
    Polygon a;
    Polygon b;
    bool clear;
  };
  constexpr std::size_t kPairs = 1024;
  std::vector<Pair> pairs;
  QuasiRandom<4> random(1);
  std::size_t clear = 0;
  for (std::size_t k = 0; k < kPairs; ++k) {
    const auto u = random.Next();
    const Vec3 a = (1 - kCell) * Vec3(u[0], u[1], 0);
    const Vec3 b((1 - kCell) * u[2], (1 - kCell) * u[3], 1);
    const Vec3 middle = 0.5 * (a + b);
    const auto beside = [&](double low) { return low + kCell < kLow || low > kHigh; };
    pairs.push_back(
        {Square(a, kCell, true), Square(b, kCell, false), beside(middle.x()) || beside(middle.y())});
    clear += pairs.back().clear ? 1U : 0U;
  }

  std::size_t next = 0;
  while (state.KeepRunning()) {
    benchmark::DoNotOptimize(occluders.Clear(pairs[next].a, pairs[next].b));
    next = (next + 1) % kPairs;
  }

  for (const Pair& pair : pairs) {
    if (occluders.Clear(pair.a, pair.b) != pair.clear) {
      Fail(state, pair.clear ? "a clear pair was not proved so" : "a pair was proved clear that is not");
      return;
    }
  }
  state.counters["clear%"] = 100 * static_cast<double>(clear) / kPairs;
}

}  // namespace

void RegisterTransport() {
  const auto form_factor = [](const char* name, std::function<double()> compute, double expected) {
    benchmark::RegisterBenchmark(name, [compute = std::move(compute), expected](benchmark::State& state) {
      BenchFormFactor(state, compute, expected);
    });
  };
  Polygon wall;
  wall.count = 4;
  wall[0] = Vec3(0, 0, 0);
  wall[1] = Vec3(0, 1, 0);
  wall[2] = Vec3(0, 1, 1);
  wall[3] = Vec3(0, 0, 1);
  wall.normal = Vec3::UnitX();
  form_factor(
      "Transport/ExchangeArea/touching", [wall] { return ExchangeArea(Floor(), wall); },
      PerpendicularSquares());
  const auto opposed = [&](const char* name, double distance) {
    form_factor(
        name, [above = Square(Vec3(0, 0, distance), 1, false)] { return ExchangeArea(Floor(), above); },
        OpposedSquares(1 / distance));
  };
  opposed("Transport/ExchangeArea/near", 0.1);
  opposed("Transport/ExchangeArea/medium", 1);
  opposed("Transport/ExchangeArea/far", 10);
  form_factor(
      "Transport/PointToPolygon",
      [above = Square(Vec3(0, 0, 1), 1, false)] {
        return PointToPolygon(Vec3::Zero(), Vec3::UnitZ(), above);
      },
      CornerSquare());
  for (const char* scene : {"plates-occluded", "cornell-box", "two-rooms"}) {
    const std::string name = "Transport/ShadowRay/" + std::string(scene);
    benchmark::RegisterBenchmark(name.c_str(),
                                 [scene](benchmark::State& state) { BenchShadowRay(state, scene); });
  }
  benchmark::RegisterBenchmark("Transport/Shaft", BenchShaft);
}

}  // namespace radbake::bench
