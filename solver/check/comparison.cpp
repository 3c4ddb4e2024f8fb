#include "solver/check/comparison.h"

#include <algorithm>
#include <cmath>

namespace radbake {
namespace {

constexpr double kNormalQuantile = 1.959964;  // 95 %, two-sided

// Σx / Σy and the half width of its 95 % interval.
struct Ratio {
  double value = 0;
  double half_width = 0;
};

Ratio RatioOf(std::span<const double> x, std::span<const double> y) {
  double sum_x = 0;
  double sum_y = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    sum_x += x[i];
    sum_y += y[i];
  }
  if (sum_y <= 0) {
    return {};
  }
  const double value = sum_x / sum_y;
  double squares = 0;
  double previous = x[0] - value * y[0];
  for (std::size_t i = 1; i < x.size(); ++i) {
    const double residual = x[i] - value * y[i];
    squares += (residual - previous) * (residual - previous);
    previous = residual;
  }
  const auto count = static_cast<double>(x.size());
  const double variance = x.size() < 2 ? 0 : squares / 2 * count / (count - 1);
  return {.value = value, .half_width = kNormalQuantile * std::sqrt(variance) / sum_y};
}

}  // namespace

void Compare(std::span<const Comparison> comparisons, CheckSummary& summary) {
  if (comparisons.empty()) {
    return;
  }
  std::vector<double> squared_error;
  std::vector<double> squared;
  std::vector<double> difference;
  std::vector<double> reference;
  double variance = 0;
  double energy = 0;
  for (const Comparison& comparison : comparisons) {
    const Rgb off = comparison.baked - comparison.reference;
    squared_error.push_back(off.square().sum() - comparison.variance);
    squared.push_back(comparison.reference.square().sum() - comparison.variance);
    difference.push_back(off.sum());
    reference.push_back(comparison.reference.sum());
    variance += comparison.variance;
    energy += squared.back();
  }
  // std::max keeps its first argument if that is not a number: a broken bake is not an exact one.
  const Ratio error = RatioOf(squared_error, squared);
  summary.error = std::sqrt(std::max(error.value, 0.0));
  summary.error_low = std::sqrt(std::max(error.value - error.half_width, 0.0));
  summary.error_high = std::sqrt(std::max(error.value + error.half_width, 0.0));
  const Ratio bias = RatioOf(difference, reference);
  summary.bias = bias.value;
  summary.bias_interval = bias.half_width;
  summary.noise = energy > 0 ? std::sqrt(variance / energy) : 0;
}

}  // namespace radbake
