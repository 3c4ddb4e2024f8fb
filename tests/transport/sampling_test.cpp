#include "solver/transport/sampling.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <vector>

namespace radbake {
namespace {

/// Of the share of `n` points that lie on the odd side of `edges` lines, in that of a single point; over many
/// such sets of lines.
double RelativeVariance(int n, int edges) {
  constexpr std::uint64_t kSets = 40;
  constexpr std::uint64_t kKeys = 200;
  double variance = 0;
  double of_one = 0;
  for (std::uint64_t set = 0; set < kSets; ++set) {
    QuasiRandom<2> lines(Hash(set));
    std::vector<std::array<double, 3>> line;
    for (int k = 0; k < edges; ++k) {
      const auto u = lines.Next();
      const double angle = 2 * std::numbers::pi * u[0];
      line.push_back(
          {std::cos(angle), std::sin(angle), 0.5 * (std::cos(angle) + std::sin(angle)) + 0.7 * (u[1] - 0.5)});
    }
    double sum = 0;
    double squares = 0;
    for (std::uint64_t key = 0; key < kKeys; ++key) {
      QuasiRandom<2> random(Hash(1000 * set + key));
      double odd = 0;
      for (int k = 0; k < n; ++k) {
        const auto x = random.Next();
        bool is_odd = false;
        for (const auto& [a, b, c] : line) {
          is_odd ^= a * x[0] + b * x[1] > c;
        }
        odd += is_odd ? 1.0 / n : 0.0;
      }
      sum += odd / kKeys;
      squares += odd * odd / kKeys;
    }
    variance += squares - sum * sum;
    of_one += sum * (1 - sum);
  }
  return variance / of_one;
}

TEST(VarianceOfHits, IsABoundAndNoFarOne) {
  for (const int n : {4, 16, 64, 256}) {
    for (const int edges : {1, 6}) {
      const double measured = RelativeVariance(n, edges);
      EXPECT_LT(measured, 1.05 * VarianceOfHits(n)) << n << " points, " << edges << " edges";
      EXPECT_GT(measured, 0.15 * VarianceOfHits(n)) << n << " points, " << edges << " edges";
    }
  }
  // That of independent points would be far off.
  EXPECT_LT(RelativeVariance(256, 1), 0.2 / 256);
}

}  // namespace
}  // namespace radbake
