#include "solver/check/comparison.h"

#include <gtest/gtest.h>

#include "tests/check/check_scenes_test.h"

namespace radbake {
namespace {

constexpr std::size_t kProbes = 256;

double Normal(std::uint64_t number) {
  return std::sqrt(-2 * std::log(1 - RandomNumber(2 * number))) *
         std::cos(2 * std::numbers::pi * RandomNumber(2 * number + 1));
}

// A bake with a known bias and error of independent probes, and references with noise of known variance.
std::vector<Comparison> Draw(double bias, double spread, double noise, std::uint64_t seed) {
  std::vector<Comparison> comparisons;
  for (std::size_t i = 0; i < kProbes; ++i) {
    const std::uint64_t key = (seed * kProbes + i) * 8;
    const double truth = 1 + 0.5 * std::sin(static_cast<double>(i) / 20);
    Comparison comparison{.baked = Rgb::Zero(), .reference = Rgb::Zero(), .variance = 3 * noise * noise};
    const double off = bias * truth + spread * Normal(key);
    for (int channel = 0; channel < 3; ++channel) {
      comparison.baked[channel] = truth + off;
      comparison.reference[channel] = truth + noise * Normal(key + 1 + static_cast<std::uint64_t>(channel));
    }
    comparisons.push_back(comparison);
  }
  return comparisons;
}

TEST(Comparison, TakesTheNoiseOfTheReferencesOut) {
  double squared_error = 0;
  double noise = 0;
  constexpr int kRuns = 100;
  for (std::uint64_t seed = 0; seed < kRuns; ++seed) {
    CheckSummary summary;
    Compare(Draw(0, 0.03, 0.06, seed), summary);
    squared_error += summary.error * summary.error / kRuns;
    noise += summary.noise / kRuns;
  }
  const double rms = std::sqrt(1 + 0.125);
  EXPECT_NEAR(std::sqrt(squared_error), 0.03 / rms, 0.001);
  EXPECT_NEAR(noise, 0.06 / rms, 0.001);
}

TEST(Comparison, CoversTheTruthAboutAsOftenAsItSays) {
  constexpr int kRuns = 400;
  int error_covered = 0;
  int bias_covered = 0;
  const double mean_square = 1 + 0.125;
  const double error = std::sqrt(0.01 * 0.01 + 0.03 * 0.03 / mean_square);
  for (std::uint64_t seed = 0; seed < kRuns; ++seed) {
    CheckSummary summary;
    Compare(Draw(0.01, 0.03, 0.02, seed), summary);
    error_covered += summary.error_low <= error && error <= summary.error_high ? 1 : 0;
    bias_covered += std::abs(summary.bias - 0.01) <= summary.bias_interval ? 1 : 0;
  }
  EXPECT_GE(error_covered, 0.91 * kRuns);
  EXPECT_LE(error_covered, 0.985 * kRuns);
  EXPECT_GE(bias_covered, 0.91 * kRuns);
  EXPECT_LE(bias_covered, 0.985 * kRuns);
}

TEST(Comparison, FindsNoErrorInAnExactBake) {
  CheckSummary summary;
  Compare(Draw(0, 0, 0, 1), summary);
  EXPECT_EQ(summary.error, 0);
  EXPECT_EQ(summary.error_high, 0);
  EXPECT_EQ(summary.bias, 0);
  EXPECT_EQ(summary.noise, 0);
}

TEST(Comparison, DoesNotTakeABrokenBakeForAnExactOne) {
  std::vector<Comparison> comparisons = Draw(0, 0, 0.01, 1);
  comparisons[5].baked[1] = NAN;
  CheckSummary summary;
  Compare(comparisons, summary);
  EXPECT_TRUE(std::isnan(summary.error));
  EXPECT_TRUE(std::isnan(summary.bias));
}

TEST(Comparison, LeavesTheSummaryOfNoProbesAsItIs) {
  CheckSummary summary;
  Compare({}, summary);
  EXPECT_EQ(summary.error, 0);
}

}  // namespace
}  // namespace radbake
