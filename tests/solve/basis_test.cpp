/// The higher bases through the whole solver: furnaces, energy, and that all orders find the same light.
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
#include "solver/refine/linker.h"
#include "solver/solve/couplings.h"
#include "solver/solve/energy.h"
#include "solver/solve/radiosity_operator.h"
#include "solver/transport/coupling.h"
#include "solver/transport/form_factor.h"
#include "solver/transport/seen_polygon.h"
#include "tests/solve/solved_scene_test.h"
#include "tests/test_scenes.h"
#include "tests/transport/plate_pair_test.h"

namespace radbake {
namespace {

using testing::CeilingPlate;
using testing::kFloorPlate;
using testing::PlatePair;
using testing::SolvedScene;
using testing::WallPlate;

constexpr std::array kOrders = {BasisOrder::kConstant, BasisOrder::kLinear, BasisOrder::kQuadratic};
constexpr std::array kHigher = {BasisOrder::kLinear, BasisOrder::kQuadratic};
constexpr std::array kNames = {"constant", "linear", "quadratic"};

const char* NameOf(BasisOrder order) {
  return kNames[static_cast<std::size_t>(order)];
}

Scene LoadForBases(const std::string& name) {
  return gltf::Document(gltf::ReadSource(RADBAKE_SOURCE_DIR "/scenes/" + name)).scene();
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

void ExpectEvenFurnaces(BasisOrder order) {
  for (const double reflectance : {0.5, 0.9, 0.99}) {
    for (const Refinement refinement :
         {Refinement::kHierarchical, Refinement::kAdaptive, Refinement::kTwoLevel}) {
      for (const Scene& scene : {testing::FurnaceBox(reflectance), testing::FurnaceSphere(reflectance, 1)}) {
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
                worst_gathered,
                (gatherer.Irradiance(inside, e, e).irradiance * lux / expected - 1).abs().maxCoeff());
          }
        }
        EXPECT_LT(worst, 1e-3) << NameOf(order) << ", reflectance " << reflectance;
        EXPECT_LT(worst_gathered, 1e-3) << NameOf(order) << ", reflectance " << reflectance;
      }
    }
  }
}

TEST(BasisFurnace, GlowsEvenlyWithLinearElements) {
  ExpectEvenFurnaces(BasisOrder::kLinear);
}

TEST(BasisFurnace, GlowsEvenlyWithQuadraticElements) {
  ExpectEvenFurnaces(BasisOrder::kQuadratic);
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
  options.direct_rays = refinement == Refinement::kHierarchical ? 1024 : 256;
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

/// How far the solution, read at places all over, is from what is gathered there: RMS, relative.
double ErrorOfSolution(const Hierarchy& hierarchy, const Visibility& visibility, const Solution& solution) {
  const Gatherer gatherer(hierarchy, solution.light, solution.links, visibility, {.rays = 64});
  double difference = 0;
  double square = 0;
  for (Index e = 0; e < hierarchy.size(); ++e) {
    if (!hierarchy[e].IsLeaf() || hierarchy.IsSky(e)) {
      continue;
    }
    QuasiRandom<2> random(Hash(e));
    for (int k = 0; k < 4; ++k) {
      const auto u = random.Next();
      const Vec3 x = PointOn(hierarchy.Shape(e), u[0], u[1]);
      const Rgb gathered = gatherer.Irradiance(x, e, Hash(e) + static_cast<std::uint64_t>(k)).irradiance;
      difference += hierarchy[e].area * (gatherer.Solved(e, x) - gathered).square().sum();
      square += hierarchy[e].area * gathered.square().sum();
    }
  }
  return std::sqrt(difference / square);
}

TEST(BasisLights, WithoutAreaLightALeafUnevenly) {
  std::array<double, 3> error{};
  for (const BasisOrder order : kOrders) {
    const SolvedScene solved(LoadForBases("three-lights.glb"), CoarseIn(Refinement::kHierarchical, order));
    error[static_cast<std::size_t>(order)] =
        ErrorOfSolution(solved.hierarchy, solved.visibility, solved.solution);
  }
  EXPECT_LT(error[1], 0.4 * error[0]);
  EXPECT_LT(error[2], 0.7 * error[1]);
}

TEST(BasisClusters, LightAndAreLitInEveryBasis) {
  Scene uneven = testing::FurnaceSphere(0.8, 1);
  uneven.materials[0].emission = Rgb::Zero();
  testing::AddQuad(uneven, testing::AddMaterial(uneven, 0, 100), Vec3(-0.3, 0.5, -0.3), Vec3(0.3, 0.5, -0.3),
                   Vec3(0.3, 0.5, 0.3), Vec3(-0.3, 0.5, 0.3));
  const Patches patches = CutIntoPatches(uneven);
  const Visibility visibility(patches);
  std::array<double, 3> error{};
  std::vector<Rgb> known;
  for (const BasisOrder order : kOrders) {
    Hierarchy hierarchy(patches, true);
    const Solution solution = Solve(hierarchy, visibility, CoarseIn(Refinement::kAdaptive, order));
    std::size_t into_clusters = 0;
    for (const Link& link : solution.links.all()) {
      into_clusters += IsCluster(link.receiver) || IsCluster(link.shooter) ? 1U : 0U;
    }
    EXPECT_GT(into_clusters, 10U);
    error[static_cast<std::size_t>(order)] = ErrorOfSolution(hierarchy, visibility, solution);
    std::span<const Rgb> patch_means = std::span(solution.light.irradiance).first(patches.patches.size());
    if (order == BasisOrder::kConstant) {
      known.assign(patch_means.begin(), patch_means.end());
    }
    double difference = 0;
    double square = 0;
    for (std::size_t p = 0; p < known.size(); ++p) {
      difference += patches.patches[p].area * (patch_means[p] - known[p]).square().sum();
      square += patches.patches[p].area * known[p].square().sum();
    }
    EXPECT_LT(std::sqrt(difference / square), 0.01) << NameOf(order);
  }
  EXPECT_LT(error[1], error[0]);
  EXPECT_LT(error[2], error[0]);
}

TEST(BasisRows, HaveTheFormFactorsMomentsAsFarAsItIsVisible) {
  const SolvedScene solved(testing::ShadowRoom(), CoarseIn(Refinement::kAdaptive, BasisOrder::kLinear));
  const Light& light = solved.solution.light;
  const Rows rows(solved.hierarchy, solved.solution.links, light);
  std::size_t partly = 0;
  for (std::size_t k = 0; k < rows.leaves().size(); ++k) {
    const Index leaf = rows.leaves()[k];
    const BasisEnd receiver(solved.hierarchy, light.basis, leaf);
    const std::span<const Link> own = solved.solution.links.Into(leaf);
    for (std::size_t l = 0; l < own.size(); ++l) {
      const Polygon shooter = solved.hierarchy.Shape(own[l].shooter);
      const BasisValues moments = MomentsOver(
          receiver, [&](const Vec3& x) { return PointToPolygon(x, receiver.seen.shape().normal, shooter); });
      partly += own[l].visibility < 1 ? 1U : 0U;
      for (std::size_t i = 1; i < 3; ++i) {
        const double expected =
            light.open[leaf] == 1 ? static_cast<double>(own[l].visibility) * moments[i] : 0;
        ASSERT_NEAR(static_cast<double>(rows.Moments(k)[2 * l + i - 1]), expected, 1e-6);
      }
    }
  }
  EXPECT_GT(partly, 100U);
}

TEST(BasisOracle, SeesWhatTheBasisLeavesOverOfTheFormFactor) {
  Scene scene;
  const Index material = testing::AddMaterial(scene, 0.5, 1);
  testing::AddQuad(scene, material, kFloorPlate[0], kFloorPlate[1], kFloorPlate[2], kFloorPlate[3]);
  const std::array<Vec3, 4> above = CeilingPlate(1.5);
  testing::AddQuad(scene, material, above[0], above[1], above[2], above[3]);
  const Patches patches = CutIntoPatches(scene);
  const Visibility visibility(patches);
  std::array<double, 3> left_over{};
  for (const BasisOrder order : kOrders) {
    Hierarchy hierarchy(patches);
    Linker linker(hierarchy, visibility, 2, 2, order);
    linker.LinkRoots();
    left_over[static_cast<std::size_t>(order)] = static_cast<double>(linker.links().Into(0)[0].variation);
  }
  EXPECT_LT(left_over[1], 0.7 * left_over[0]);
  EXPECT_LT(left_over[2], 0.3 * left_over[1]);
}

TEST(BasisGather, SeesShootersAsUnevenAsTheyAre) {
  Scene scene;
  testing::AddBox(scene, testing::AddMaterial(scene, 0.5, 0), Vec3(0, 0, 0), Vec3(1, 1, 1), true);
  testing::AddQuad(scene, testing::AddMaterial(scene, 0, 100), Vec3(0.1, 0.7, 0.1), Vec3(0.3, 0.7, 0.1),
                   Vec3(0.3, 0.7, 0.3), Vec3(0.1, 0.7, 0.3));
  const SolvedScene fine(scene, FineIn(Refinement::kAdaptive, BasisOrder::kConstant));
  for (const BasisOrder order : kHigher) {
    SolveOptions options = CoarseIn(Refinement::kAdaptive, order);
    options.w_min = 4e-3;
    const SolvedScene solved(scene, options);
    Light flat = solved.solution.light;
    for (std::size_t k = 0; k < flat.shooting_coefficients.size(); ++k) {
      if (k % flat.basis.count() != 0) {
        flat.shooting_coefficients[k] = Rgb::Zero();
      }
    }
    // Both as the solutions have them, without a look at what is near.
    const GatherOptions as_solved{.rays = 256, .uneven = 100};
    const auto error = [&](const Light& light) {
      const Gatherer known(fine.hierarchy, fine.solution.light, fine.solution.links, fine.visibility,
                           as_solved);
      const Gatherer gatherer(solved.hierarchy, light, solved.solution.links, solved.visibility, as_solved);
      double difference = 0;
      for (Index root = 0; root < 6; ++root) {
        QuasiRandom<2> random(Hash(root));
        for (int k = 0; k < 50; ++k) {
          const auto u = random.Next();
          const Vec3 x = PointOn(solved.hierarchy.Shape(root), u[0], u[1]);
          difference +=
              (gatherer.Irradiance(x, gatherer.SolverLeaf(root, x), Hash(root) + static_cast<Index>(k))
                   .irradiance -
               known.Irradiance(x, known.SolverLeaf(root, x), Hash(root) + static_cast<Index>(k)).irradiance)
                  .square()
                  .sum();
        }
      }
      return std::sqrt(difference);
    };
    EXPECT_LT(error(solved.solution.light), 0.5 * error(flat)) << NameOf(order);
  }
}

/// Two plates of which the floor gathers from the other one alone, which is half hidden.
struct OneLink {
  OneLink(BasisOrder order, bool divided)
      : pair(kFloorPlate, WallPlate(1, 0.5), order), hierarchy(*pair.hierarchy), visibility(pair.patches) {
    if (divided) {
      hierarchy.Divide(0);
    }
    light.basis = Basis(order);
    light.Extend(hierarchy);
    light.PullOpen(hierarchy);
    Link link{.receiver = 0, .shooter = 1};
    link.form_factor =
        static_cast<float>(ExchangeArea(hierarchy.Shape(0), hierarchy.Shape(1)) / hierarchy.Area(0));
    link.visibility = 0.5F;
    links.Assign({link}, hierarchy.size(), 0);
  }

  /// What the other plate's φ_j brings to the place `x` of the floor.
  double Brings(std::size_t j, const Vec3& x) const {
    const Rows rows(hierarchy, links, light);
    const Couplings couplings(hierarchy, visibility, links, light);
    const RadiosityOperator radiosity_operator(hierarchy, links, rows, couplings, light);
    const auto count = static_cast<Eigen::Index>(light.basis.count());
    LeafValues radiosity = LeafValues::Zero(3, radiosity_operator.size());
    Index leaf = kNone;
    Eigen::Index column = 0;
    for (std::size_t k = 0; k < rows.leaves().size(); ++k) {
      const Polygon shape = hierarchy.Shape(rows.leaves()[k]);
      if (rows.leaves()[k] == 1) {
        radiosity(0, static_cast<Eigen::Index>(k) * count + static_cast<Eigen::Index>(j)) = 1;
      } else if ((NearestPoint(shape, x) - x).norm() < 1e-9) {
        leaf = rows.leaves()[k];
        column = static_cast<Eigen::Index>(k) * count;
      }
    }
    const LeafValues irradiance = radiosity_operator.Gather(radiosity);
    const BasisValues values = light.basis.At(leaf, x);
    double sum = 0;
    for (Eigen::Index i = 0; i < count; ++i) {
      sum += values[static_cast<std::size_t>(i)] * irradiance(0, column + i);
    }
    return sum;
  }

  PlatePair pair;
  Hierarchy& hierarchy;
  Visibility visibility;
  Light light;
  Links links;
};

TEST(BasisOperator, BringsWhatTheCouplingsSayToALeafAndPushedDown) {
  for (const BasisOrder order : kHigher) {
    const OneLink whole(order, false);
    const OneLink divided(order, true);
    const std::size_t count = BasisCount(order);
    const std::vector<float> couplings = whole.pair.Coupled();
    const Polygon floor = whole.hierarchy.Shape(0);
    for (const Vec3& x :
         {Vec3(0.6 * floor[0] + 0.4 * floor.Centroid()), Vec3(0.3 * floor[1] + 0.7 * floor[2])}) {
      const BasisValues values = whole.light.basis.At(0, x);
      for (std::size_t j = 1; j < count; ++j) {
        double expected = 0;
        for (std::size_t i = 0; i < count; ++i) {
          expected += 0.5 * values[i] * static_cast<double>(couplings[(count - 1) * i + j - 1]);
        }
        EXPECT_NEAR(whole.Brings(j, x), expected, 1e-6) << NameOf(order) << " " << j;
        EXPECT_NEAR(divided.Brings(j, x), expected, 1e-6) << NameOf(order) << " " << j;
      }
    }
  }
}

TEST(BasisEnergy, FollowsALeafsPolynomialOutOfTheScene) {
  // A lamp at one side of a floor, a black wall beside: most of what is reflected there ends on the wall.
  Scene scene;
  testing::AddQuad(scene, testing::AddMaterial(scene, 0.9, 0), kFloorPlate[0], kFloorPlate[1], kFloorPlate[2],
                   kFloorPlate[3]);
  const std::array<Vec3, 4> wall = WallPlate(0, 0);
  testing::AddQuad(scene, testing::AddMaterial(scene, 0, 0), wall[0], wall[1], wall[2], wall[3]);
  testing::AddQuad(scene, testing::AddMaterial(scene, 0, 100), Vec3(0.1, 0.4, 0.45), Vec3(0.2, 0.4, 0.45),
                   Vec3(0.2, 0.4, 0.55), Vec3(0.1, 0.4, 0.55));
  SolveOptions options;
  options.refinement = Refinement::kHierarchical;
  options.a_min = 0.02;
  options.f_max = 0.3;
  options.basis = BasisOrder::kLinear;
  const SolvedScene solved(scene, options);
  EXPECT_LT(BalanceEnergy(solved.hierarchy, solved.solution.light, solved.visibility).imbalance, 0.002);
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
      return a.size() == b.size() &&
             (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(Rgb)) == 0);
    };
    EXPECT_TRUE(same(one.solution.light.radiosity, two.solution.light.radiosity)) << NameOf(order);
    EXPECT_TRUE(same(one.solution.light.shooting_coefficients, two.solution.light.shooting_coefficients))
        << NameOf(order);
    EXPECT_EQ(one.solution.links.size(), two.solution.links.size());
  }
}

}  // namespace
}  // namespace radbake
