// Couplings against plain sums over many points, and against the closed form.
#include "solver/transport/coupling.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "solver/transport/seen_polygon.h"
#include "tests/transport/plate_pair_test.h"

namespace radbake {
namespace {

using testing::CeilingPlate;
using testing::kFloorPlate;
using testing::PlatePair;
using testing::WallPlate;

/// T_ij by the kernel at pairs of points: three of Gauss and Legendre in each of `cells`⁴ cells.
double Brute(const PlatePair& pair, std::size_t i, std::size_t j, int cells) {
  const Polygon to = pair.hierarchy->Shape(0);
  const Polygon from = pair.hierarchy->Shape(1);
  const auto points_of = [&](const Polygon& p) {
    const std::array<double, 3> node = {0.5 - std::sqrt(0.15), 0.5, 0.5 + std::sqrt(0.15)};
    const std::array<double, 3> weight = {5.0 / 18, 8.0 / 18, 5.0 / 18};
    std::vector<QuadraturePoint> points;
    for (int s = 0; s < 3 * cells; ++s) {
      for (int t = 0; t < 3 * cells; ++t) {
        const auto a = static_cast<std::size_t>(s % 3);
        const auto b = static_cast<std::size_t>(t % 3);
        points.push_back(
            {p[0] + (s / 3 + node[a]) / cells * (p[1] - p[0]) + (t / 3 + node[b]) / cells * (p[3] - p[0]),
             weight[a] * weight[b] / (cells * cells)});
      }
    }
    return points;
  };
  const std::vector<QuadraturePoint> on_from = points_of(from);
  double sum = 0;
  for (const QuadraturePoint& x : points_of(to)) {
    double seen = 0;
    for (const QuadraturePoint& y : on_from) {
      const Vec3 along = y.x - x.x;
      const double cosines = std::max(0.0, along.dot(to.normal)) * std::max(0.0, -along.dot(from.normal));
      seen += y.weight * pair.basis.At(1, y.x)[j] * cosines / std::pow(along.squaredNorm(), 2);
    }
    sum += x.weight * pair.basis.At(0, x.x)[i] * seen;
  }
  return sum / std::numbers::pi * pair.hierarchy->Area(1);
}

/// The largest error of a coupling, as a share of the form factor.
double ErrorOfCouplings(const std::array<Vec3, 4>& shooter, BasisOrder order) {
  const PlatePair pair(kFloorPlate, shooter, order);
  const std::vector<float> couplings = pair.Coupled();
  constexpr int kCells = 5;
  double worst = 0;
  for (std::size_t i = 0; i < pair.basis.count(); ++i) {
    for (std::size_t j = 1; j < pair.basis.count(); ++j) {
      const double coupling = static_cast<double>(couplings[(pair.basis.count() - 1) * i + j - 1]);
      worst = std::max(worst, std::abs(coupling - Brute(pair, i, j, kCells)));
    }
  }
  return worst / Brute(pair, 0, 0, kCells);
}

TEST(BasisCouplings, AreTheKernelsMomentsTheMoreExactlyTheSmootherItIs) {
  EXPECT_LT(ErrorOfCouplings(CeilingPlate(1.5), BasisOrder::kLinear), 0.012);
  EXPECT_LT(ErrorOfCouplings(CeilingPlate(4), BasisOrder::kLinear), 0.0008);
  EXPECT_LT(ErrorOfCouplings(CeilingPlate(1.5), BasisOrder::kQuadratic), 0.003);
  EXPECT_LT(ErrorOfCouplings(CeilingPlate(4), BasisOrder::kQuadratic), 0.0002);
  EXPECT_LT(ErrorOfCouplings(WallPlate(1, 0.5), BasisOrder::kLinear), 0.03);
  EXPECT_LT(ErrorOfCouplings(WallPlate(4, 2), BasisOrder::kLinear), 0.001);
  EXPECT_LT(ErrorOfCouplings(WallPlate(1, 0.5), BasisOrder::kQuadratic), 0.01);
  EXPECT_LT(ErrorOfCouplings(WallPlate(4, 2), BasisOrder::kQuadratic), 0.0002);
}

TEST(BasisCouplings, OfTouchingPlatesKeepTheirEnergyAndAreBounded) {
  for (const BasisOrder order : {BasisOrder::kLinear, BasisOrder::kQuadratic}) {
    const PlatePair pair(kFloorPlate, WallPlate(0, 0), order);
    const std::vector<float> couplings = pair.Coupled();
    const Polygon floor = pair.hierarchy->Shape(0);
    const Polygon wall = pair.hierarchy->Shape(1);
    constexpr double kFormFactor = 0.2000438;  // of squares that share an edge
    // What the floor gets of each φ_j of the wall: by the closed form from many points of it.
    std::vector<double> means(pair.basis.count());
    constexpr int kSteps = 200;
    for (int s = 0; s < kSteps; ++s) {
      for (int t = 0; t < kSteps; ++t) {
        const Vec3 y =
            wall[0] + (s + 0.5) / kSteps * (wall[1] - wall[0]) + (t + 0.5) / kSteps * (wall[3] - wall[0]);
        const double seen = PointToPolygon(y, wall.normal, floor) / (kSteps * kSteps);
        for (std::size_t j = 0; j < means.size(); ++j) {
          means[j] += seen * pair.basis.At(1, y)[j];
        }
      }
    }
    EXPECT_NEAR(means[0], kFormFactor, 1e-4);
    for (std::size_t j = 1; j < means.size(); ++j) {
      EXPECT_NEAR(static_cast<double>(couplings[j - 1]), means[j], 0.03 * kFormFactor)
          << static_cast<int>(order) << " " << j;
    }
    for (const float coupling : couplings) {
      EXPECT_LT(std::abs(coupling), 2 * kFormFactor);
    }
  }
}

}  // namespace
}  // namespace radbake
