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

/// The floor plate, a plate above it, and right below the low-x half of that one something that hides it.
struct HalfHidden {
  HalfHidden() {
    const std::array<Vec3, 4> shooter = CeilingPlate(1);
    Scene scene;
    const Index material = testing::AddMaterial(scene, 0.5, 1);
    for (const auto& plate : {kFloorPlate, shooter}) {
      testing::AddQuad(scene, material, plate[0], plate[1], plate[2], plate[3]);
    }
    constexpr double kHeight = 0.9999;
    testing::AddQuad(scene, material, Vec3(0.2, kHeight, -1), Vec3(0.8, kHeight, -1), Vec3(0.8, kHeight, 2),
                     Vec3(0.2, kHeight, 2));
    patches = CutIntoPatches(scene);
  }
  Patches patches;
};

TEST(HiddenMoments, AreTheCovarianceOfVisibilityWithTheShootersBasis) {
  const HalfHidden scene;
  const Visibility visibility(scene.patches);
  const Hierarchy hierarchy(scene.patches);
  for (const BasisOrder order : {BasisOrder::kLinear, BasisOrder::kQuadratic}) {
    Basis basis(order);
    basis.Extend(hierarchy);
    const BasisEnd receiver(hierarchy, basis, 0);
    const BasisEnd shooter(hierarchy, basis, 1);
    constexpr int kKeys = 4000;
    constexpr int kRays = 8;
    BasisValues found{};
    for (std::uint64_t key = 0; key < kKeys; ++key) {
      const BasisValues moments = HiddenMoments(visibility, receiver, shooter, basis[1], Hash(key), kRays);
      for (std::size_t j = 0; j < moments.size(); ++j) {
        found[j] += moments[j] / kKeys;
      }
    }
    // By the closed form of what each place of the shooter sees of the floor.
    const Polygon from = shooter.seen.shape();
    const Polygon hiding = hierarchy.Shape(2);
    double edge = hiding[0].x();
    for (int k = 1; k < hiding.count; ++k) {
      edge = std::max(edge, hiding[k].x());
    }
    BasisValues all{};
    BasisValues open{};
    constexpr int kSteps = 200;
    for (int s = 0; s < kSteps; ++s) {
      for (int t = 0; t < kSteps; ++t) {
        const Vec3 y =
            from[0] + (s + 0.5) / kSteps * (from[1] - from[0]) + (t + 0.5) / kSteps * (from[3] - from[0]);
        const double seen = PointToPolygon(y, from.normal, receiver.seen.shape());
        const BasisValues values = basis.At(1, y);
        const bool is_open = y.x() > edge;
        for (std::size_t j = 0; j < values.size(); ++j) {
          all[j] += seen * values[j];
          open[j] += is_open ? seen * values[j] : 0;
        }
      }
    }
    EXPECT_EQ(found[0], 0);
    double largest = 0;
    for (std::size_t j = 1; j < basis.count(); ++j) {
      const double expected = (open[j] - open[0] / all[0] * all[j]) / all[0];
      largest = std::max(largest, std::abs(expected));
      EXPECT_NEAR(found[j], expected, 0.015) << static_cast<int>(order) << " " << j;
    }
    EXPECT_GT(largest, 0.3);
  }
}

TEST(HiddenMoments, AreNoneWhereNothingIsInBetween) {
  const PlatePair pair(kFloorPlate, CeilingPlate(1), BasisOrder::kLinear);
  const Visibility visibility(pair.patches);
  const BasisEnd receiver(*pair.hierarchy, pair.basis, 0);
  const BasisEnd shooter(*pair.hierarchy, pair.basis, 1);
  for (const double moment : HiddenMoments(visibility, receiver, shooter, pair.basis[1], 1, 8)) {
    EXPECT_EQ(moment, 0);
  }
}

}  // namespace
}  // namespace radbake
