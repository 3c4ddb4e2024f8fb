#include "solver/check/check.h"

#include <gtest/gtest.h>
#include <oneapi/tbb/task_arena.h>

#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "tests/check/check_scenes_test.h"

namespace radbake {
namespace {

CheckOptions Options(std::size_t probes, std::uint64_t seed = 1) {
  return {.probes = probes, .probe_noise = 0.02, .max_paths = 65536, .seed = seed, .stop = {}};
}

std::vector<double> Members(const CheckSummary& s) {
  return {static_cast<double>(s.probes),
          static_cast<double>(s.paths),
          static_cast<double>(s.rays),
          s.error,
          s.error_low,
          s.error_high,
          s.bias,
          s.bias_interval,
          s.missing,
          s.noise};
}

TEST(Check, FindsNoErrorInAnExactBake) {
  for (const double size : {1.0, 1e-6, 1e16}) {
    const Scene scene = Furnace(0.5, 2, size);
    const CheckSummary summary = Check(scene, UniformBake(scene, FurnaceIrradiance(0.5, 2)), Options(100));
    EXPECT_EQ(summary.probes, 100);
    EXPECT_LT(summary.error, 0.01);
    EXPECT_LE(summary.error_low, 0.002);
    EXPECT_LE(std::abs(summary.bias), 1.5 * summary.bias_interval);
    EXPECT_LT(summary.bias_interval, 0.005);
    EXPECT_EQ(summary.missing, 0);
    EXPECT_LT(summary.noise, 0.025);
    EXPECT_GT(summary.paths, 100);
    EXPECT_GT(summary.rays, summary.paths);
  }
}

TEST(Check, MeasuresABakeThatIsATenthTooBright) {
  const Scene scene = Furnace(0.5, 2);
  const CheckSummary summary =
      Check(scene, UniformBake(scene, 1.1 * FurnaceIrradiance(0.5, 2)), Options(200));
  EXPECT_NEAR(summary.error, 0.1, 0.005);
  EXPECT_NEAR(summary.bias, 0.1, 0.005);
  EXPECT_LE(summary.error_low, 0.101);
  EXPECT_GE(summary.error_high, 0.099);
}

TEST(Check, MeasuresABakeThatIsATenthTooDark) {
  const Scene scene = Furnace(0.5, 2);
  const CheckSummary summary =
      Check(scene, UniformBake(scene, 0.9 * FurnaceIrradiance(0.5, 2)), Options(200));
  EXPECT_NEAR(summary.error, 0.1, 0.005);
  EXPECT_NEAR(summary.bias, -0.1, 0.005);
}

TEST(Check, LeavesOutWhatNobodySeesUnderABody) {
  // A furnace, with a glowing block on its floor; under that it is dark, whatever the bake says.
  Scene scene = Furnace(0.5, 2);
  const Vec3 low(0.2, 0.2, 0);
  const Vec3 x = 0.5 * Vec3::UnitX();
  const Vec3 y = 0.5 * Vec3::UnitY();
  const Vec3 z = 0.5 * Vec3::UnitZ();
  AddQuad(scene, 0, low + z, x, y);
  AddQuad(scene, 0, low, z, y);
  AddQuad(scene, 0, low + x, y, z);
  AddQuad(scene, 0, low, x, z);
  AddQuad(scene, 0, low + y, z, x);
  const CheckSummary summary = Check(scene, UniformBake(scene, FurnaceIrradiance(0.5, 2)), Options(200));
  EXPECT_LT(summary.error, 0.01);
  EXPECT_EQ(summary.missing, 0);
}

TEST(Check, LeavesOutWhatIsHiddenInBodiesThatTouch) {
  // Inside of one, a ray may meet another's side instead of its own in the same plane.
  Scene scene = Furnace(0.5, 2);
  const Index white = AddMaterial(scene, 0.999, 0);
  const auto add_body = [&](const Vec3& low, const Vec3& high) { AddRoom(scene, white, high, low - high); };
  add_body({0.1, 0.1, 0.1}, {0.9, 0.9, 0.2});
  add_body({0.5, 0.2, 0.2}, {0.8, 0.7, 0.8});
  add_body({0.2, 0.2, 0.2}, {0.5, 0.7, 0.8});
  const CheckSummary summary = Check(scene, UniformBake(scene, FurnaceIrradiance(0.5, 2)), Options(2000));
  EXPECT_LT(summary.error, 0.03);
}

// Every quad of the room in n by n cells of two triangles, at each of their own vertices a random error.
struct NoisyBake {
  BakedTriangles baked;
  double error = 0;  // the exact relative RMS error
  double bias = 0;
};

NoisyBake AddNoise(const Scene& scene, double irradiance, double amplitude, int n) {
  NoisyBake bake;
  double squares = 0;
  double sum = 0;
  for (const Surface& surface : scene.surfaces) {
    const Vec3 u = (surface.positions[1] - surface.positions[0]) / n;
    const Vec3 v = (surface.positions[3] - surface.positions[0]) / n;
    for (int cell = 0; cell < 2 * n * n; ++cell) {
      const Vec3 corner = surface.positions[0] + cell / 2 % n * u + cell / 2 / n * v;
      const auto first = static_cast<Index>(bake.baked.positions.size());
      bake.baked.positions.push_back(corner);
      bake.baked.positions.emplace_back(corner + u + (cell % 2) * v);
      bake.baked.positions.emplace_back(corner + (1 - cell % 2) * u + v);
      bake.baked.triangles.push_back({first, first + 1, first + 2});
      std::array<double, 3> off{};
      for (Index i = 0; i < 3; ++i) {
        off[i] = amplitude * (2 * RandomNumber(first + i) - 1);
        bake.baked.irradiance.emplace_back(Rgb::Constant(irradiance * (1 + off[i])));
      }
      // ∫ over a triangle of (a·λ₁ + b·λ₂ + c·λ₃)² is its area times (a² + b² + c² + ab + bc + ca)/6.
      const auto& [a, b, c] = off;
      squares += (a * a + b * b + c * c + a * b + b * c + c * a) / 6;
      sum += (a + b + c) / 3;
    }
  }
  const auto triangles = static_cast<double>(bake.baked.triangles.size());
  bake.error = std::sqrt(squares / triangles);
  bake.bias = sum / triangles;
  return bake;
}

TEST(Check, CoversAKnownErrorWithItsInterval) {
  const Scene scene = Furnace(0.3, 2);
  const NoisyBake bake = AddNoise(scene, FurnaceIrradiance(0.3, 2), 0.06, 8);
  ASSERT_GT(bake.error, 0.02);
  int error_covered = 0;
  int bias_covered = 0;
  constexpr int kSeeds = 20;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const CheckSummary summary = Check(scene, bake.baked, Options(128, seed));
    error_covered += summary.error_low <= bake.error && bake.error <= summary.error_high ? 1 : 0;
    bias_covered += std::abs(summary.bias - bake.bias) <= summary.bias_interval ? 1 : 0;
    EXPECT_LT(summary.error_high - summary.error_low, 0.4 * bake.error);
  }
  EXPECT_GE(error_covered, 16);
  EXPECT_GE(bias_covered, 16);
}

TEST(Check, CountsProbesWhereTheBakeHasNoSurface) {
  const Scene scene = Furnace(0.5, 2);
  const CheckSummary summary = Check(scene, UniformBake(scene, FurnaceIrradiance(0.5, 2), 3), Options(120));
  EXPECT_NEAR(summary.missing, 1.0 / 6, 1e-12);
  EXPECT_LT(summary.error, 0.01);
}

TEST(Check, ComparesEachSideOfADoubleSidedSurface) {
  // Two flat black rooms, one above the other, with a black sheet for a wall between them: all that a side of
  // the sheet sees is its room's lamps.
  Scene scene;
  const Index dim = AddMaterial(scene, 0, 2);
  const Index bright = AddMaterial(scene, 0, 8);
  AddQuad(scene, AddMaterial(scene, 0, 0, Sides::kBoth), Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY());
  AddRoom(scene, dim, {0, 0, -0.1}, {1, 1, 0.1});
  AddRoom(scene, bright, {0, 0, 0}, {1, 1, 0.1});
  std::erase_if(scene.surfaces, [&](const Surface& surface) {
    return surface.material != 2 && surface.positions[0].z() == 0 && surface.positions[1].z() == 0 &&
           surface.positions[2].z() == 0;
  });
  ASSERT_EQ(scene.surfaces.size(), 11);
  BakedTriangles baked;
  baked.positions = scene.surfaces[0].positions;
  baked.positions.insert(baked.positions.end(), scene.surfaces[0].positions.begin(),
                         scene.surfaces[0].positions.end());
  baked.irradiance.assign(4, Rgb::Constant(8 * std::numbers::pi));
  baked.irradiance.insert(baked.irradiance.end(), 4, Rgb::Constant(2 * std::numbers::pi));
  baked.triangles = {{0, 1, 2}, {0, 2, 3}, {4, 6, 5}, {4, 7, 6}};
  const CheckSummary right = Check(scene, baked, Options(480));
  EXPECT_NEAR(right.missing, 2.8 / 4.8, 0.01);
  EXPECT_LT(right.error, 0.01);
  baked.triangles = {{0, 2, 1}, {0, 3, 2}, {4, 5, 6}, {4, 6, 7}};
  EXPECT_NEAR(Check(scene, baked, Options(480)).error, 6 * std::sqrt(2 / 68.0), 0.02);
}

TEST(Check, IsTheSameOnOneAndOnTwoThreads) {
  Scene scene = Furnace(0.5, 0);
  AddQuad(scene, AddMaterial(scene, 0, 9), {0.3, 0.3, 0.9}, 0.3 * Vec3::UnitY(), 0.3 * Vec3::UnitX());
  const BakedTriangles baked = UniformBake(scene, 1);
  std::array<CheckSummary, 2> summaries;
  for (int threads = 1; threads <= 2; ++threads) {
    tbb::task_arena(threads).execute(
        [&] { summaries[static_cast<std::size_t>(threads - 1)] = Check(scene, baked, Options(100)); });
  }
  EXPECT_EQ(Members(summaries[0]), Members(summaries[1]));
  EXPECT_GT(summaries[0].error, 0);
}

TEST(Check, DrawsOtherProbesForAnotherSeed) {
  const Scene scene = Furnace(0.5, 2);
  const BakedTriangles baked = UniformBake(scene, 1.2 * FurnaceIrradiance(0.5, 2));
  EXPECT_NE(Check(scene, baked, Options(10, 1)).error, Check(scene, baked, Options(10, 2)).error);
}

TEST(Check, NeedsMorePathsForLessNoise) {
  Scene scene = Furnace(0.5, 0);
  AddQuad(scene, AddMaterial(scene, 0, 9), {0.3, 0.3, 0.9}, 0.3 * Vec3::UnitY(), 0.3 * Vec3::UnitX());
  const BakedTriangles baked = UniformBake(scene, 1);
  CheckOptions options = Options(64);
  const CheckSummary coarse = Check(scene, baked, options);
  options.probe_noise = 0.01;
  const CheckSummary fine = Check(scene, baked, options);
  EXPECT_GT(fine.paths, 2 * coarse.paths);
  EXPECT_LT(coarse.noise, 0.022);
  EXPECT_LT(fine.noise, 0.011);
  options.max_paths = 16;
  EXPECT_EQ(Check(scene, baked, options).paths, 64 * (64 + 16));
}

TEST(Check, StopsWithTheProbesDoneSoFar) {
  const Scene scene = Furnace(0.5, 2);
  const BakedTriangles baked = UniformBake(scene, 1.1 * FurnaceIrradiance(0.5, 2));
  CheckOptions options = Options(1000);
  options.probe_noise = 1;
  const std::size_t total = [&] {
    std::size_t asked = 0;
    options.stop = [&] { return ++asked == 0; };
    EXPECT_EQ(Check(scene, baked, options).probes, 1000);
    return asked;
  }();
  std::size_t asked = 0;
  options.stop = [&] { return ++asked > total * 3 / 4; };
  const CheckSummary summary = Check(scene, baked, options);
  EXPECT_GT(summary.probes, 200);
  EXPECT_LT(summary.probes, 800);
  EXPECT_NEAR(summary.bias, 0.1, 0.01);
  options.stop = [] { return true; };
  EXPECT_EQ(Check(scene, baked, options).probes, 0);
}

TEST(Check, RefusesWhatItCannotMeasure) {
  const Scene dark = Furnace(0.5, 0);
  EXPECT_THROW(Check(dark, UniformBake(dark, 1), Options(10)), InputError);
  const Scene scene = Furnace(0.5, 1);
  EXPECT_THROW(Check(scene, {}, Options(10)), InputError);
  EXPECT_THROW(Check({}, {}, Options(10)), InputError);
}

}  // namespace
}  // namespace radbake
