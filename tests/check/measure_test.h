/// Irradiance at a place by the path tracer, with its standard error.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "solver/check/path_tracer.h"
#include "solver/check/sample_points.h"
#include "tests/check/check_scenes_test.h"

namespace radbake {

struct Measured {
  double irradiance;
  double standard_error;
};

/// Irradiance of the first channel, in lx.
inline Measured Measure(const TracedScene& scene, const PathTracer& tracer, const Place& place,
                        std::uint64_t stream) {
  constexpr int kBatches = 16;
  double sum = 0;
  double squares = 0;
  for (std::uint64_t batch = 0; batch < kBatches; ++batch) {
    const double e = tracer.Irradiance(place, 128, SubStream(stream, batch)).irradiance[0];
    sum += e;
    squares += e * e;
  }
  const double unit = std::numbers::pi * scene.brightest;
  const double mean = sum / kBatches;
  return {unit * mean, unit * std::sqrt(std::max(0.0, squares / kBatches - mean * mean) / (kBatches - 1))};
}

inline Measured Measure(const Scene& scene, const Vec3& point, const Vec3& normal) {
  const TracedScene traced(scene);
  return Measure(traced, PathTracer(traced), {.point = traced.normalization(point), .normal = normal}, 1);
}

inline void ExpectMeasured(const Measured& measured, double expected) {
  EXPECT_NEAR(measured.irradiance, expected, 5 * measured.standard_error + 1e-9 * expected);
  EXPECT_LT(measured.standard_error, 0.05 * expected);
}

}  // namespace radbake
