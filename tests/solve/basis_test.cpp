/// The higher bases through the whole solver: their couplings against plain sums over many points, furnaces,
/// energy, and that all orders find the same light.
#include <gtest/gtest.h>
#include <oneapi/tbb/global_control.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <numbers>
#include <string>
#include <vector>

#include "solver/gltf/document.h"
#include "solver/solve/couplings.h"
#include "solver/solve/energy.h"
#include "solver/solve/radiosity_operator.h"
#include "solver/transport/coupling.h"
#include "solver/transport/form_factor.h"
#include "tests/solve/solved_scene_test.h"
#include "tests/test_scenes.h"

namespace radbake {
namespace {

using testing::SolvedScene;

constexpr std::array kOrders = {BasisOrder::kConstant, BasisOrder::kLinear, BasisOrder::kQuadratic};
constexpr std::array kHigher = {BasisOrder::kLinear, BasisOrder::kQuadratic};
constexpr std::array kNames = {"constant", "linear", "quadratic"};

const char* NameOf(BasisOrder order) {
  return kNames[static_cast<std::size_t>(order)];
}

Scene LoadForBases(const std::string& name) {
  return gltf::Document(gltf::ReadSource(RADBAKE_SOURCE_DIR "/scenes/" + name)).scene();
}

/// Two patches, each with a basis.
struct Pair {
  Pair(const std::array<Vec3, 4>& a, const std::array<Vec3, 4>& b, BasisOrder order) {
    Scene scene;
    const Index material = testing::AddMaterial(scene, 0.5, 1);
    testing::AddQuad(scene, material, a[0], a[1], a[2], a[3]);
    testing::AddQuad(scene, material, b[0], b[1], b[2], b[3]);
    patches = CutIntoPatches(scene);
    hierarchy.emplace(patches);
    basis = Basis(order);
    basis.Extend(*hierarchy);
  }

  /// T_ij by the kernel at pairs of points: three of Gauss and Legendre in each of `cells`⁴ cells.
  double Brute(std::size_t i, std::size_t j, int cells) const {
    const Polygon to = hierarchy->Shape(0);
    const Polygon from = hierarchy->Shape(1);
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
        seen += y.weight * basis.At(1, y.x)[j] * cosines / std::pow(along.squaredNorm(), 2);
      }
      sum += x.weight * basis.At(0, x.x)[i] * seen;
    }
    return sum / std::numbers::pi * hierarchy->Area(1);
  }

  std::vector<float> Coupled() const {
    std::vector<float> couplings(basis.count() * (basis.count() - 1));
    CoupleShaped({*hierarchy, basis, 0}, {*hierarchy, basis, 1}, basis.count(), couplings);
    return couplings;
  }

  Patches patches;
  std::optional<Hierarchy> hierarchy;
  Basis basis;
};

const std::array<Vec3, 4> kFloor = {Vec3(0, 0, 0), Vec3(0, 0, 1), Vec3(1, 0, 1), Vec3(1, 0, 0)};

std::array<Vec3, 4> Ceiling(double height) {
  return {Vec3(0.3, height, 0), Vec3(1.3, height, 0), Vec3(1.3, height, 0.8), Vec3(0.3, height, 0.8)};
}
std::array<Vec3, 4> Wall(double distance, double base) {
  return {Vec3(-distance, base, 0), Vec3(-distance, base + 1, 0), Vec3(-distance, base + 1, 1),
          Vec3(-distance, base, 1)};
}

/// The largest error of a coupling, as a share of the form factor.
double ErrorOfCouplings(const std::array<Vec3, 4>& shooter, BasisOrder order) {
  const Pair pair(kFloor, shooter, order);
  const std::vector<float> couplings = pair.Coupled();
  constexpr int kCells = 5;
  double worst = 0;
  for (std::size_t i = 0; i < pair.basis.count(); ++i) {
    for (std::size_t j = 1; j < pair.basis.count(); ++j) {
      const double coupling = static_cast<double>(couplings[(pair.basis.count() - 1) * i + j - 1]);
      worst = std::max(worst, std::abs(coupling - pair.Brute(i, j, kCells)));
    }
  }
  return worst / pair.Brute(0, 0, kCells);
}

TEST(BasisCouplings, AreTheKernelsMomentsTheMoreExactlyTheSmootherItIs) {
  EXPECT_LT(ErrorOfCouplings(Ceiling(1.5), BasisOrder::kLinear), 0.012);
  EXPECT_LT(ErrorOfCouplings(Ceiling(4), BasisOrder::kLinear), 0.0008);
  EXPECT_LT(ErrorOfCouplings(Ceiling(1.5), BasisOrder::kQuadratic), 0.003);
  EXPECT_LT(ErrorOfCouplings(Ceiling(4), BasisOrder::kQuadratic), 0.0002);
  EXPECT_LT(ErrorOfCouplings(Wall(1, 0.5), BasisOrder::kLinear), 0.03);
  EXPECT_LT(ErrorOfCouplings(Wall(4, 2), BasisOrder::kLinear), 0.001);
  EXPECT_LT(ErrorOfCouplings(Wall(1, 0.5), BasisOrder::kQuadratic), 0.01);
  EXPECT_LT(ErrorOfCouplings(Wall(4, 2), BasisOrder::kQuadratic), 0.0002);
}

TEST(BasisCouplings, OfTouchingPlatesKeepTheirEnergyAndAreBounded) {
  for (const BasisOrder order : kHigher) {
    const Pair pair(kFloor, Wall(0, 0), order);
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
          << NameOf(order) << " " << j;
    }
    for (const float coupling : couplings) {
      EXPECT_LT(std::abs(coupling), 2 * kFormFactor);
    }
  }
}

SolveOptions CoarseIn(Refinement refinement, BasisOrder order) {
  SolveOptions options;
  options.refinement = refinement;
  options.basis = order;
  options.a_min = 1e-3;
  options.f_max = 0.1;
  options.w_min = 1e-3;
  return options;
}

TEST(BasisFurnace, GlowsEvenlyInEveryBasis) {
  for (const BasisOrder order : kHigher) {
    for (const double reflectance : {0.5, 0.9, 0.99}) {
      for (const Refinement refinement :
           {Refinement::kHierarchical, Refinement::kAdaptive, Refinement::kTwoLevel}) {
        for (const Scene& scene :
             {testing::FurnaceBox(reflectance), testing::FurnaceSphere(reflectance, 1)}) {
          SolvedScene solved(scene, CoarseIn(refinement, order));
          const double expected = std::numbers::pi / (1 - reflectance);
          const Gatherer gatherer(solved.hierarchy, solved.solution.light, solved.solution.links,
                                  solved.visibility, GatherOptions());
          double worst = 0;
          double worst_gathered = 0;
          for (Index e = 0; e < solved.hierarchy.size(); ++e) {
            if (solved.hierarchy[e].IsLeaf()) {
              const Polygon shape = solved.hierarchy.Shape(e);
              const Vec3 inside = 0.99 * shape[0] + 0.01 * shape.Centroid();
              const double lux = solved.patches.normalization.radiance;
              worst = std::max(worst, (gatherer.Solved(e, inside) * lux / expected - 1).abs().maxCoeff());
              worst_gathered = std::max(
                  worst_gathered, (gatherer.Irradiance(inside, e, e) * lux / expected - 1).abs().maxCoeff());
            }
          }
          EXPECT_LT(worst, 1e-3) << NameOf(order) << ", reflectance " << reflectance;
          EXPECT_LT(worst_gathered, 1e-3) << NameOf(order) << ", reflectance " << reflectance;
        }
      }
    }
  }
}

TEST(BasisRows, HaveMomentsThatCancelInAClosedRoom) {
  for (const BasisOrder order : kHigher) {
    Scene scene;
    testing::AddBox(scene, testing::AddMaterial(scene, 0.5, 0), Vec3(0, 0, 0), Vec3(1, 1, 1), true);
    scene.surfaces[1].material = testing::AddMaterial(scene, 0, 1);
    const SolvedScene solved(scene, CoarseIn(Refinement::kAdaptive, order));
    const Rows rows(solved.hierarchy, solved.solution.links, solved.solution.light);
    const std::size_t shapes = BasisCount(order) - 1;
    double worst = 0;
    double largest = 0;
    for (std::size_t k = 0; k < rows.leaves().size(); ++k) {
      std::vector<double> sums(shapes);
      for (std::size_t i = 0; i < rows.Moments(k).size(); ++i) {
        sums[i % shapes] += static_cast<double>(rows.Moments(k)[i]);
        largest = std::max(largest, std::abs(static_cast<double>(rows.Moments(k)[i])));
      }
      for (const double sum : sums) {
        worst = std::max(worst, std::abs(sum));
      }
    }
    EXPECT_LT(worst, 1e-5);
    EXPECT_GT(largest, 0.02);
  }
}

double DifferenceOfBases(const SolvedScene& a, const SolvedScene& b) {
  double difference = 0;
  double square = 0;
  for (Index root = 0; root < a.hierarchy.root_count(); ++root) {
    const Rgb& known = b.solution.light.irradiance[root];
    difference += a.hierarchy[root].area * (a.solution.light.irradiance[root] - known).square().sum();
    square += a.hierarchy[root].area * known.square().sum();
  }
  return std::sqrt(difference / square);
}

SolveOptions FineIn(Refinement refinement, BasisOrder order) {
  SolveOptions options;
  options.refinement = refinement;
  options.basis = order;
  options.a_min = refinement == Refinement::kAdaptive ? 1e-5 : 1e-3;
  options.f_max = 0.02;
  options.w_min = 2e-4;
  options.gradient = 0.2;
  options.tolerance = 1e-5;
  options.visibility_rays = 16;
  return options;
}

/// The lowest value of any leaf's polynomial at its corners, as a share of the brightest mean.
double Lowest(const SolvedScene& solved) {
  double lowest = 0;
  double brightest = 0;
  const Light& light = solved.solution.light;
  for (Index e = 0; e < solved.hierarchy.size(); ++e) {
    if (solved.hierarchy[e].IsLeaf() && !solved.hierarchy.IsSky(e)) {
      const Polygon shape = solved.hierarchy.Shape(e);
      brightest = std::max(brightest, light.radiosity[e].maxCoeff());
      for (int k = 0; k < shape.count; ++k) {
        lowest =
            std::min(lowest, Evaluate(light.ShootingPolynomial(e), light.basis.At(e, shape[k])).minCoeff());
      }
    }
  }
  return lowest / brightest;
}

// The suite whose name begins with Accuracy takes too long under a sanitizer.
TEST(AccuracyOfBases, AllAgreeKeepTheirEnergyAndStayPositive) {
  for (const char* name : {"cornell-box.glb", "two-rooms.glb"}) {
    const Scene scene = LoadForBases(name);
    const SolvedScene reference(scene, FineIn(Refinement::kAdaptive, BasisOrder::kConstant));
    for (const BasisOrder order : kHigher) {
      for (const Refinement refinement : {Refinement::kHierarchical, Refinement::kAdaptive}) {
        const SolvedScene solved(scene, FineIn(refinement, order));
        EXPECT_LT(DifferenceOfBases(solved, reference), 0.01) << NameOf(order) << " in " << name;
        EXPECT_LT(BalanceEnergy(solved.hierarchy, solved.solution.light, solved.visibility).imbalance, 0.005)
            << NameOf(order) << " in " << name;
        EXPECT_GT(Lowest(solved), -1e-12) << NameOf(order) << " in " << name;
      }
    }
  }
}

TEST(Basis, GivesTheSameBitsOnAnyNumberOfThreads) {
  const Scene scene = testing::ShadowRoom();
  for (const BasisOrder order : kOrders) {
    const auto solve = [&](std::size_t threads) {
      const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
      return SolvedScene(scene, CoarseIn(Refinement::kAdaptive, order));
    };
    const SolvedScene one = solve(1);
    const SolvedScene two = solve(2);
    const auto same = [](const std::vector<Rgb>& a, const std::vector<Rgb>& b) {
      return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(Rgb)) == 0;
    };
    EXPECT_TRUE(same(one.solution.light.radiosity, two.solution.light.radiosity)) << NameOf(order);
    EXPECT_TRUE(same(one.solution.light.shooting_coefficients, two.solution.light.shooting_coefficients))
        << NameOf(order);
    EXPECT_EQ(one.solution.links.size(), two.solution.links.size());
  }
}

}  // namespace
}  // namespace radbake
