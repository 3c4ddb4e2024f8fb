#include "solver/transport/visibility.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "solver/transport/form_factor.h"
#include "solver/transport/seen_polygon.h"
#include "tests/test_scenes.h"

namespace radbake {
namespace {

/// A surface of one triangle.
void AddTriangle(Scene& scene, Index material, const Vec3& a, const Vec3& b, const Vec3& c) {
  Surface surface;
  surface.material = material;
  surface.positions = {a, b, c};
  surface.triangles = {{0, 1, 2}};
  scene.surfaces.push_back(surface);
}

/// A unit square on the floor, patch 0, one that it sees, patch 1, and a triangle between them, patch 2, no
/// higher than `height`.
Patches WithATriangleBetween(const std::array<Vec3, 4>& seen, double height = 0.8) {
  Scene scene;
  const Index material = testing::AddMaterial(scene, 0.5, 1);
  testing::AddQuad(scene, material, Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(1, 1, 0), Vec3(0, 1, 0));
  testing::AddQuad(scene, material, seen[0], seen[1], seen[2], seen[3]);
  AddTriangle(scene, material, Vec3(0.15, 0.1, 0.05), Vec3(0.3, 0.9, 0.1), Vec3(0.25, 0.4, height));
  return CutIntoPatches(scene);
}
/// The wall above the floor's edge at x = 0.
Patches TouchingWall() {
  return WithATriangleBetween({Vec3(0, 0, 0), Vec3(0, 1, 0), Vec3(0, 1, 1), Vec3(0, 0, 1)});
}
Patches Ceiling() {
  return WithATriangleBetween({Vec3(0, 0, 1), Vec3(0, 1, 1), Vec3(1, 1, 1), Vec3(1, 0, 1)});
}

/// A lid that hangs low above the floor: near, but not touching, and hardly hidden.
Patches LowLid() {
  return WithATriangleBetween({Vec3(0, 0, 0.16), Vec3(0, 1, 0.16), Vec3(1, 1, 0.16), Vec3(1, 0, 0.16)},
                              0.155);
}

Polygon ShapeOf(const Patch& patch) {
  Polygon polygon;
  polygon.count = patch.corner_count;
  polygon.normal = patch.normal;
  for (int k = 0; k < polygon.count; ++k) {
    polygon[k] = patch.corner[static_cast<std::size_t>(k)];
  }
  return polygon;
}

/// Point-to-polygon form factor from `x` to the part of `seen` that `blocker` hides, in closed form: to the
/// part of the blocker in the pyramid of `seen` over `x`.
double HiddenFrom(const Vec3& x, const Vec3& n, const Polygon& seen, const Polygon& blocker) {
  Polygon part = blocker;
  for (int k = 0; k < seen.count && part.count > 0; ++k) {
    Vec3 inwards = (seen[k] - x).cross(seen[(k + 1) % seen.count] - x).normalized();
    if (inwards.dot(seen.Centroid() - x) < 0) {
      inwards = -inwards;
    }
    part = ClipToFront(part, {inwards, inwards.dot(x)});
  }
  if (part.count < 3) {
    return 0;
  }
  if (PlaneOf(part).Distance(x) < 0) {
    std::reverse(part.corner.begin(), part.corner.begin() + part.count);
    part.normal = -part.normal;
  }
  return PointToPolygon(x, n, part);
}

/// The visible share of the light between patches 0 and 1, rays unasked.
double ExpectedVisibility(const Patches& patches) {
  const Polygon floor = ShapeOf(patches.patches[0]);
  const Polygon seen = ShapeOf(patches.patches[1]);
  const Polygon blocker = ShapeOf(patches.patches[2]);
  constexpr int kGrid = 200;
  double hidden = 0;
  for (int u = 0; u < kGrid; ++u) {
    for (int v = 0; v < kGrid; ++v) {
      const Vec3 x = floor[0] + (floor[1] - floor[0]) * ((u + 0.5) / kGrid) +
                     (floor[3] - floor[0]) * ((v + 0.5) / kGrid);
      hidden += HiddenFrom(x, floor.normal, seen, blocker);
    }
  }
  return 1 - hidden / (kGrid * kGrid) * Area(floor) / ExchangeArea(floor, seen);
}

struct Estimate {
  double mean = 0;
  double standard_error = 0;
};

template <typename Sample>
Estimate Average(int count, const Sample& sample) {
  double sum = 0;
  double squares = 0;
  for (int k = 0; k < count; ++k) {
    const double value = sample(static_cast<std::uint64_t>(k));
    sum += value;
    squares += value * value;
  }
  const double mean = sum / count;
  return {mean, std::sqrt(std::max(0.0, squares / count - mean * mean) / (count - 1))};
}

TEST(Visibility, CarriedBetweenPartlyHiddenElementsIsUnbiasedWhetherTheyTouchOrNot) {
  for (const Patches& patches : {TouchingWall(), Ceiling()}) {
    const Visibility visibility(patches);
    const Polygon a = ShapeOf(patches.patches[0]);
    const Polygon b = ShapeOf(patches.patches[1]);
    const double exchange_area = ExchangeArea(a, b);
    const double expected = ExpectedVisibility(patches);
    ASSERT_GT(expected, 0.5);
    ASSERT_LT(expected, 0.95);
    for (const int rays : {32, 128}) {
      const Estimate there = Average(200'000 / rays, [&](std::uint64_t k) {
        return visibility.BetweenElements(a, b, exchange_area, Hash(k), rays).carried;
      });
      const Estimate back = Average(200'000 / rays, [&](std::uint64_t k) {
        return visibility.BetweenElements(b, a, exchange_area, Hash(k), rays).carried;
      });
      EXPECT_NEAR(there.mean, expected, 4 * there.standard_error) << rays << " rays";
      EXPECT_NEAR(back.mean, expected, 4 * back.standard_error) << rays << " rays";
      EXPECT_LT(there.standard_error, 0.01);
    }
  }
}

// A share above 1 is as much chance as one below.
TEST(Visibility, CarriedBetweenHardlyHiddenElementsIsUnbiased) {
  const Patches patches = LowLid();
  const Visibility visibility(patches);
  const Polygon a = ShapeOf(patches.patches[0]);
  const Polygon b = ShapeOf(patches.patches[1]);
  const double exchange_area = ExchangeArea(a, b);
  const double expected = ExpectedVisibility(patches);
  ASSERT_GT(expected, 0.95);
  const Estimate found = Average(50'000, [&](std::uint64_t k) {
    return visibility.BetweenElements(a, b, exchange_area, Hash(k), 32).carried;
  });
  EXPECT_NEAR(found.mean, expected, 4 * found.standard_error);
  EXPECT_LT(found.standard_error, 0.001);
}

// An oracle refines where much was judged, and what was judged to be little stays: if those carried more,
// light would be made.
TEST(Visibility, CarriesNoMoreWhereLittleWasJudged) {
  const Patches patches = Ceiling();
  const Visibility visibility(patches);
  const Polygon a = ShapeOf(patches.patches[0]);
  const Polygon b = ShapeOf(patches.patches[1]);
  const double exchange_area = ExchangeArea(a, b);
  const double expected = ExpectedVisibility(patches);
  constexpr int kPairs = 10'000;
  constexpr int kRays = 32;
  double products = 0;
  double squares = 0;
  for (std::uint64_t k = 0; k < kPairs; ++k) {
    const SampledVisibility sampled = visibility.BetweenElements(a, b, exchange_area, Hash(k), kRays);
    const double product = (sampled.judged - expected) * (sampled.carried - expected);
    products += product;
    squares += product * product;
  }
  EXPECT_NEAR(products, 0, 4 * std::sqrt(squares));
}

Polygon Quad(const Patches& patches, const std::array<Vec3, 4>& world) {
  Polygon polygon;
  polygon.count = 4;
  for (int k = 0; k < 4; ++k) {
    polygon[k] = patches.normalization.ToNormalized(world[static_cast<std::size_t>(k)]);
  }
  polygon.normal = (polygon[1] - polygon[0]).cross(polygon[3] - polygon[0]).normalized();
  return polygon;
}

TEST(Visibility, IsOneBetweenOpenElementsAndZeroBetweenHiddenOnes) {
  const Patches patches = CutIntoPatches(testing::ShadowRoom());
  const Visibility visibility(patches);
  // On both sides of the edge between the floor and the wall x = 0, away from the slab.
  const Polygon floor = Quad(patches, {Vec3(0, 0, 0), Vec3(0, 0, 2), Vec3(0.4, 0, 2), Vec3(0.4, 0, 0)});
  const Polygon wall = Quad(patches, {Vec3(0, 0, 0), Vec3(0, 0.4, 0), Vec3(0, 0.4, 2), Vec3(0, 0, 2)});
  for (std::uint64_t key = 0; key < 100; ++key) {
    const SampledVisibility open =
        visibility.BetweenElements(floor, wall, ExchangeArea(floor, wall), key, 32);
    EXPECT_EQ(open.judged, 1);
    EXPECT_NEAR(open.carried, 1, 1e-6);
  }
  // Below the slab, and above it.
  const Polygon below = Quad(patches, {Vec3(0.8, 0, 0.8), Vec3(0.8, 0, 1), Vec3(1, 0, 1), Vec3(1, 0, 0.8)});
  const Polygon above = Quad(patches, {Vec3(0.8, 2, 0.8), Vec3(1, 2, 0.8), Vec3(1, 2, 1), Vec3(0.8, 2, 1)});
  for (std::uint64_t key = 0; key < 100; ++key) {
    const SampledVisibility hidden =
        visibility.BetweenElements(below, above, ExchangeArea(below, above), key, 32);
    EXPECT_EQ(hidden.carried, 0);
    EXPECT_EQ(hidden.judged, 0);
  }
}

TEST(Visibility, CountsTheRaysThatItCasts) {
  const Patches patches = TouchingWall();
  const Visibility visibility(patches);
  const Polygon a = ShapeOf(patches.patches[0]);
  const Polygon b = ShapeOf(patches.patches[1]);
  EXPECT_EQ(visibility.Counted().rays, 0U);
  visibility.BetweenElements(a, b, ExchangeArea(a, b), 1, 64);
  EXPECT_EQ(visibility.Counted().rays, 64U);
}

TEST(Visibility, FromAPointIsTheShareOfTheLightThatIsNotHidden) {
  const Patches patches = Ceiling();
  const Visibility visibility(patches);
  const Polygon seen = ShapeOf(patches.patches[1]);
  const Polygon blocker = ShapeOf(patches.patches[2]);
  const Vec3 up = Vec3::UnitZ();
  for (const double at : {0.02, 0.1, 0.4}) {
    const Vec3 x = patches.normalization.ToNormalized(Vec3(at, 0.45, 0));
    const double hidden = HiddenFrom(x, up, seen, blocker) / PointToPolygon(x, up, seen);
    ASSERT_GT(hidden, 0.02);
    QuasiRandom<2> random(5);
    EXPECT_NEAR(visibility.FromPoint(x, up, seen, random, 65536), 1 - hidden, 1e-3);
  }
}

TEST(Visibility, FromAPointOfWhatIsHardlySeenIsRightOnAverage) {
  const Patches patches = TouchingWall();
  const Visibility visibility(patches);
  const Polygon wall = ShapeOf(patches.patches[1]);
  const Vec3 up = Vec3::UnitZ();
  const Vec3 behind = patches.normalization.ToNormalized(Vec3(0.6, 0.5, 0));
  QuasiRandom<2> random(3);
  const double known = visibility.FromPoint(behind, up, wall, random, 1 << 18);
  ASSERT_GT(known, 0);
  ASSERT_LT(known, 1);
  double sum = 0;
  constexpr int kLooks = 20000;
  for (int k = 0; k < kLooks; ++k) {
    QuasiRandom<2> few(Hash(static_cast<std::uint64_t>(k)));
    sum += visibility.FromPoint(behind, up, wall, few, 8);
  }
  // The ratio of two sums of eight is a little off.
  EXPECT_NEAR(sum / kLooks, known, 0.05 * std::min(known, 1 - known));
  EXPECT_EQ(visibility.Counted().rays, (1U << 18U) + 8U * kLooks);
  EXPECT_EQ(visibility.FromPoint(behind, -up, wall, random, 64), 0) << "the wall is behind";
}

/// A room of 2 m with a box of 0.6 m on its floor.
Scene RoomWithABoxOnTheFloor() {
  Scene scene;
  const Index material = testing::AddMaterial(scene, 0.5, 1);
  testing::AddBox(scene, material, Vec3(0, 0, 0), Vec3(2, 2, 2), true);
  testing::AddBox(scene, material, Vec3(0.7, 0, 0.7), Vec3(1.3, 0.6, 1.3), false);
  return scene;
}

TEST(Visibility, KnowsWhatIsSealedUnderABox) {
  const Patches patches = CutIntoPatches(RoomWithABoxOnTheFloor());
  const Visibility visibility(patches);
  std::uint64_t rays = 0;
  const auto is_sealed = [&](const Vec3& world) {
    Polygon upwards;
    upwards.normal = Vec3::UnitY();
    return visibility.IsSealed(patches.normalization.ToNormalized(world), upwards, rays);
  };
  for (const Vec3& under : {Vec3(1, 0, 1), Vec3(0.71, 0, 0.8), Vec3(1.29, 0, 1.29)}) {
    EXPECT_TRUE(is_sealed(under)) << under.transpose();
  }
  EXPECT_GT(rays, 0U);
  for (const Vec3& beside : {Vec3(0.1, 0, 0.1), Vec3(0.69, 0, 1), Vec3(1.31, 0, 1.2), Vec3(1, 0.6, 1)}) {
    EXPECT_FALSE(is_sealed(beside)) << beside.transpose();
  }
}

TEST(Visibility, FindsTheOpenShareOfAFloorWithABoxOnIt) {
  const Patches patches = CutIntoPatches(RoomWithABoxOnTheFloor());
  const Visibility visibility(patches);
  EXPECT_NEAR(visibility.OpenShare(ShapeOf(patches.patches[0]), 1, 4096), 1 - 0.36 / 4, 0.005);
  EXPECT_EQ(visibility.OpenShare(ShapeOf(patches.patches[1]), 1, 64), 1) << "the ceiling";
}

TEST(Visibility, NothingIsSealedInAConvexRoomAndNoRayIsCast) {
  const Patches patches = CutIntoPatches(testing::FurnaceBox(0.5));
  const Visibility visibility(patches);
  EXPECT_EQ(visibility.OpenShare(ShapeOf(patches.patches[0]), 1, 64), 1);
  EXPECT_EQ(visibility.Counted().rays, 0U);
}

}  // namespace
}  // namespace radbake
