#include <gtest/gtest.h>

#include "solver/hierarchy/hierarchy.h"
#include "solver/solve/solver.h"
#include "solver/transport/node_transport.h"
#include "tests/test_scenes.h"

namespace radbake {
namespace {

/// A box of n × n quadrilaterals a side.
void AddFineBox(Scene& scene, Index material, const Vec3& low, const Vec3& high, int n, bool inwards) {
  const Vec3 size = high - low;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const Vec3 u = size[(axis + 1) % 3] / n * Vec3::Unit((axis + 1) % 3);
    const Vec3 v = size[(axis + 2) % 3] / n * Vec3::Unit((axis + 2) % 3);
    for (const bool far : {false, true}) {
      const Vec3 corner = low + (far ? size[axis] * Vec3::Unit(axis) : Vec3(Vec3::Zero()));
      for (int i = 0; i < n; ++i) {
        for (int k = 0; k < n; ++k) {
          const Vec3 at = corner + i * u + k * v;
          const Vec3& first = far != inwards ? u : v;
          const Vec3& second = far != inwards ? v : u;
          testing::AddQuad(scene, material, at, at + first, at + first + second, at + second);
        }
      }
    }
  }
}

struct Clustered {
  Clustered(const Scene& scene, double w_min)
      : patches(CutIntoPatches(scene)),
        hierarchy(patches, true),
        visibility(patches),
        solution(Solve(hierarchy, visibility, Options(w_min))) {}
  static SolveOptions Options(double w_min) {
    SolveOptions options;
    options.a_min = 1e-6;
    options.w_min = w_min;
    return options;
  }
  Patches patches;
  Hierarchy hierarchy;
  Visibility visibility;
  Solution solution;

  double MeanIrradiance(Index surface_begin, Index surface_end) const {
    double sum = 0;
    double area = 0;
    for (Index p = 0; p < hierarchy.surface_root_count(); ++p) {
      if (hierarchy.PatchOf(p).surface >= surface_begin && hierarchy.PatchOf(p).surface < surface_end) {
        sum += hierarchy[p].area * Luminance(solution.light.irradiance[p]);
        area += hierarchy[p].area;
      }
    }
    return sum / area;
  }
};

/// A closed room with walls of two sides, in the open under a sky.
TEST(ClusteredSolution, LessLightLeaksThroughAWallTheFinerTheLinks) {
  Scene scene;
  const Index grey = testing::AddMaterial(scene, 0.5, 0);
  AddFineBox(scene, grey, Vec3(0, 0, 0), Vec3(2, 2, 2), 3, true);
  const auto inside = static_cast<Index>(scene.surfaces.size());
  AddFineBox(scene, grey, Vec3(-0.1, -0.1, -0.1), Vec3(2.1, 2.1, 2.1), 3, false);
  scene.environment = Rgb::Constant(1);
  const auto leak = [&](double w_min) {
    const Clustered solved(scene, w_min);
    return solved.MeanIrradiance(0, inside) / solved.MeanIrradiance(inside, 2 * inside);
  };
  EXPECT_LT(leak(4e-3), 0.05);
  EXPECT_LT(leak(2.5e-4), 0.001);
}

/// A closed box in a closed box, light in the gap between them alone.
TEST(ClusteredSolution, LeavesAClosedBoxBesideABrightWallAllButDark) {
  Scene scene;
  const Index grey = testing::AddMaterial(scene, 0.5, 0);
  AddFineBox(scene, grey, Vec3(0, 0, 0), Vec3(2, 2, 2), 6, true);
  const auto inside = static_cast<Index>(scene.surfaces.size());
  AddFineBox(scene, grey, Vec3(-0.05, -0.05, -0.05), Vec3(2.05, 2.05, 2.05), 6, false);
  AddFineBox(scene, testing::AddMaterial(scene, 0.5, 1), Vec3(-0.5, -0.5, -0.5), Vec3(2.5, 2.5, 2.5), 6,
             true);
  const auto end = static_cast<Index>(scene.surfaces.size());
  for (const double w_min : {1e-3, 2e-4}) {
    const Clustered solved(scene, w_min);
    EXPECT_LT(solved.MeanIrradiance(0, inside), 0.01 * solved.MeanIrradiance(inside, end)) << w_min;
  }
}

/// Solved with a_min = 1e-4, so that what refines without need ends.
Solution SolveWith(const Scene& scene, bool clustering) {
  const Patches patches = CutIntoPatches(scene);
  Hierarchy hierarchy(patches, clustering);
  const Visibility visibility(patches);
  SolveOptions options = Clustered::Options(2e-4);
  options.a_min = 1e-4;
  return Solve(hierarchy, visibility, options);
}

TEST(ClusteredSolution, OfClosedRoomsNeedsAtMostAFewTimesTheLinksOfOneWithoutClusters) {
  Scene fine;
  AddFineBox(fine, testing::AddMaterial(fine, 0.5, 1), Vec3(0, 0, 0), Vec3(3, 2, 1), 4, true);
  for (const Scene& scene : {testing::FurnaceBox(0.5), testing::ShadowRoom(), fine}) {
    const Solution alone = SolveWith(scene, false);
    const Solution clustered = SolveWith(scene, true);
    EXPECT_LE(clustered.links.size(), 3 * alone.links.size());
    EXPECT_LE(clustered.light.radiosity.size(), 2 * alone.light.radiosity.size());
  }
}

/// The first links already bring what the last ones do.
TEST(ClusteredSolution, OfAFurnaceIsThereBeforeAnyLinkIsRefined) {
  const Scene scene = testing::FurnaceBox(0.5);
  const Patches patches = CutIntoPatches(scene);
  Hierarchy hierarchy(patches, true);
  const Visibility visibility(patches);
  SolveOptions options;
  options.w_min = 1;  // no second pass
  options.visibility_rays = 4096;
  const Solution solution = Solve(hierarchy, visibility, options);
  ASSERT_EQ(solution.links.size(), 1U);
  const double exact = Luminance(patches.patches[0].emission) / (1 - 0.5);
  for (Index patch = 0; patch < hierarchy.surface_root_count(); ++patch) {
    EXPECT_NEAR(Luminance(solution.light.irradiance[patch]) / exact, 1, 0.05);
  }
}

TEST(ClusteredSolution, OfWhatALinkBringsAllFallsOnOpenParts) {
  // Half of the floor lies sealed under a box.
  Scene scene;
  const Index black = testing::AddMaterial(scene, 0, 0);
  testing::AddQuad(scene, black, Vec3(0, 0, 0), Vec3(0, 0, 1), Vec3(1, 0, 1), Vec3(1, 0, 0));
  testing::AddBox(scene, black, Vec3(0, 0, 0), Vec3(1, 0.3, 0.5), false);
  scene.environment = Rgb::Constant(1);
  const Patches patches = CutIntoPatches(scene);
  Hierarchy hierarchy(patches, true);
  const Visibility visibility(patches);
  SolveOptions options;
  options.w_min = 1;  // no second pass
  const Solution solution = Solve(hierarchy, visibility, options);
  EXPECT_NEAR(solution.light.open[0], 0.5, 0.05);
  double fallen = 0;
  for (Index patch = 0; patch < hierarchy.surface_root_count(); ++patch) {
    fallen += hierarchy[patch].area * Luminance(solution.light.irradiance[patch]);
  }
  double brought = 0;
  for (const Link& link : solution.links.all()) {
    if (IsElement(link.shooter)) {
      ASSERT_TRUE(IsCluster(link.receiver));
      brought += hierarchy.Area(link.receiver) * static_cast<double>(link.form_factor * link.visibility) *
                 Luminance(hierarchy.PatchOf(link.shooter).emission);
    }
  }
  EXPECT_GT(brought, 0);
  EXPECT_NEAR(fallen / brought, 1, 0.02);
}

TEST(Solution, DoesNotDivideForLightThatReachesNothing) {
  Scene scene;
  const Index grey = testing::AddMaterial(scene, 0.5, 0);
  testing::AddBox(scene, grey, Vec3(0, 0, 0), Vec3(3, 3, 3), true);
  testing::AddBox(scene, grey, Vec3(1, 1, 1), Vec3(2, 2, 2), false);
  PunctualLight light;
  light.position = Vec3(1.5, 1.5, 1.5);
  light.intensity = Rgb::Constant(1);
  scene.lights.push_back(light);
  for (const bool clustering : {false, true}) {
    EXPECT_LT(SolveWith(scene, clustering).links.size(), 5000U);
  }
}

/// A closed room of many patches sees nothing but itself, touching walls and all.
TEST(ClusterTransport, OfAClosedRoomToItselfIsOneInTheMeanOfFewRays) {
  Scene scene;
  AddFineBox(scene, testing::AddMaterial(scene, 0.5, 1), Vec3(0, 0, 0), Vec3(2, 2, 2), 4, true);
  const Patches patches = CutIntoPatches(scene);
  const Hierarchy hierarchy(patches, true);
  const Visibility visibility(patches);
  const Clusters& clusters = hierarchy.clusters();
  // Whatever the pairs of nodes that share the room out: the root's children, theirs, and so on.
  std::vector<Index> nodes = {ClusterNode(0)};
  for (int level = 0; level < 3; ++level) {
    double sum = 0;
    constexpr std::uint64_t kKeys = 64;
    for (const Index receiver : nodes) {
      for (const Index shooter : nodes) {
        for (std::uint64_t key = 0; key < kKeys && (receiver != shooter || IsCluster(receiver)); ++key) {
          const NodeTransport found = BetweenNodes(hierarchy, visibility, receiver, shooter, Hash(key), 8);
          sum += hierarchy.Area(receiver) / patches.area * found.form_factor * found.visibility;
        }
      }
    }
    EXPECT_NEAR(sum / kKeys, 1, 0.02) << nodes.size();
    std::vector<Index> below;
    for (const Index node : nodes) {
      const std::span<const Index> children = clusters.Children(node - kFirstCluster);
      below.insert(below.end(), children.begin(), children.end());
    }
    nodes = below;
  }
}

/// A wall of two sides above a floor: the floor sees one of them.
TEST(ClusterTransport, KnowsTheSourcesThatAReceiverSees) {
  Scene scene;
  const Index white = testing::AddMaterial(scene, 0.5, 1);
  AddFineBox(scene, white, Vec3(0, 1, 0), Vec3(1, 1.01, 1), 2, false);
  testing::AddQuad(scene, white, Vec3(0, 0, 0), Vec3(0, 0, 1), Vec3(1, 0, 1), Vec3(1, 0, 0));
  const Patches patches = CutIntoPatches(scene);
  const Hierarchy hierarchy(patches, true);
  const Visibility visibility(patches);
  const auto floor = static_cast<Index>(hierarchy.surface_root_count() - 1);
  const NodeTransport found = BetweenNodes(hierarchy, visibility, floor, ClusterNode(0), 1, 64);
  double sum = 0;
  for (const PatchShare& source : found.sources) {
    EXPECT_LT(hierarchy.PatchOf(source.patch).normal.y(), -0.9);
    sum += static_cast<double>(source.share);
  }
  EXPECT_GE(found.sources.size(), 4U);
  EXPECT_NEAR(sum, 1, 1e-5);
}

/// A box with walls of two sides before a lamp: of its patches only the outer ones before the lamp are lit.
TEST(ClusterTransport, KnowsThePatchesThatItsLightFallsOn) {
  Scene scene;
  const Index white = testing::AddMaterial(scene, 0.5, 1);
  AddFineBox(scene, white, Vec3(0, 0, 0), Vec3(1, 1, 1), 3, true);
  const auto outside = static_cast<Index>(scene.surfaces.size());
  AddFineBox(scene, white, Vec3(-0.01, -0.01, -0.01), Vec3(1.01, 1.01, 1.01), 3, false);
  testing::AddQuad(scene, white, Vec3(0, 3, 0), Vec3(1, 3, 0), Vec3(1, 3, 1), Vec3(0, 3, 1));
  const Patches patches = CutIntoPatches(scene);
  const Hierarchy hierarchy(patches, true);
  const Visibility visibility(patches);
  const auto lamp = static_cast<Index>(hierarchy.surface_root_count() - 1);
  const NodeTransport found = BetweenNodes(hierarchy, visibility, ClusterNode(0), lamp, 1, 1024);
  double sum = 0;
  for (const PatchShare& receiver : found.receivers) {
    EXPECT_GT(hierarchy.PatchOf(receiver.patch).normal.y(), 0.9);
    EXPECT_GE(hierarchy.PatchOf(receiver.patch).surface, outside);
    sum += static_cast<double>(receiver.share);
  }
  EXPECT_EQ(found.receivers.size(), 9U);
  EXPECT_NEAR(sum, 1, 1e-5);
}

}  // namespace
}  // namespace radbake
