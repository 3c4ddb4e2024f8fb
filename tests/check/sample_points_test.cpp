#include "solver/check/sample_points.h"

#include <gtest/gtest.h>

#include <set>

namespace radbake {
namespace {

TEST(SamplePoints, FillEveryElementaryIntervalOnce) {
  constexpr unsigned kBits = 8;
  for (std::uint32_t dimension = 0; dimension < 4; ++dimension) {
    const SamplePoints points(Scramble(dimension + 17));
    for (unsigned columns = 0; columns <= kBits; ++columns) {
      std::set<std::pair<unsigned, unsigned>> cells;
      for (std::uint32_t i = 0; i < 1U << kBits; ++i) {
        const auto [u, v] = points.Point(i, dimension);
        ASSERT_TRUE(u >= 0 && u < 1 && v >= 0 && v < 1);
        cells.emplace(static_cast<unsigned>(u * (1U << columns)),
                      static_cast<unsigned>(v * (1U << (kBits - columns))));
      }
      EXPECT_EQ(cells.size(), 1U << kBits);
    }
  }
}

TEST(SamplePoints, AreUniformOverTheStreams) {
  constexpr int kStreams = 20000;
  double mean_u = 0;
  double mean_v = 0;
  double product = 0;
  double across = 0;  // two dimensions of one stream
  for (std::uint64_t stream = 0; stream < kStreams; ++stream) {
    const SamplePoints points(stream);
    const auto [u, v] = points.Point(5, 3);
    mean_u += u / kStreams;
    mean_v += v / kStreams;
    product += u * v / kStreams;
    across += u * points.Point(5, 4)[0] / kStreams;
  }
  EXPECT_NEAR(mean_u, 0.5, 0.01);
  EXPECT_NEAR(mean_v, 0.5, 0.01);
  EXPECT_NEAR(product, 0.25, 0.01);
  EXPECT_NEAR(across, 0.25, 0.01);
}

TEST(SamplePoints, DoNotRunInStepOverTheDimensions) {
  const SamplePoints points(3);
  double covariance = 0;
  constexpr std::uint32_t kCount = 1024;
  for (std::uint32_t i = 0; i < kCount; ++i) {
    covariance += (points.Point(i, 0)[0] - 0.5) * (points.Point(i, 1)[0] - 0.5) / kCount;
  }
  EXPECT_NEAR(covariance, 0, 5 * (1.0 / 12) / 32);
}

}  // namespace
}  // namespace radbake
