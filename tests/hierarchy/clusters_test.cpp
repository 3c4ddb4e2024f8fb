#include "solver/hierarchy/clusters.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/test_scenes.h"

namespace radbake {
namespace {

/// A room with a sphere of 320 triangles in it.
Patches RoomWithSphere() {
  Scene scene = testing::FurnaceSphere(0.5, 2);
  testing::AddBox(scene, 0, Vec3(-4, -4, -4), Vec3(4, 4, 4), true);
  return CutIntoPatches(scene);
}

TEST(Clusters, HoldEveryPatchOnceAndKnowWhatIsBelow) {
  const Patches patches = RoomWithSphere();
  const Clusters clusters(patches);
  std::vector<int> seen(patches.patches.size(), 0);
  for (Index c = 0; c < clusters.size(); ++c) {
    double area = 0;
    for (const Index child : clusters.Children(c)) {
      if (IsCluster(child)) {
        const Cluster& below = clusters[child - kFirstCluster];
        EXPECT_EQ(below.parent, c);
        EXPECT_GT(child - kFirstCluster, c);
        EXPECT_LE((below.centre - clusters[c].centre).norm(), clusters[c].radius);
        area += below.area;
      } else {
        ++seen[child];
        EXPECT_EQ(clusters.Above(child), c);
        area += patches.patches[child].area;
        for (int k = 0; k < patches.patches[child].corner_count; ++k) {
          const Vec3& corner = patches.patches[child].corner[static_cast<std::size_t>(k)];
          EXPECT_LE((corner - clusters[c].centre).norm(), clusters[c].radius * (1 + 1e-12));
        }
      }
    }
    EXPECT_NEAR(area, clusters[c].area, 1e-12);
  }
  EXPECT_TRUE(std::all_of(seen.begin(), seen.end(), [](int times) { return times == 1; }));
  EXPECT_NEAR(clusters[0].area, patches.area, 1e-12);
}

TEST(Clusters, KeepLargePatchesApartFromSmallOnes) {
  const Patches patches = RoomWithSphere();
  const Clusters clusters(patches);
  for (Index patch = 0; patch < patches.patches.size(); ++patch) {
    EXPECT_EQ(clusters.Above(patch) == 0, patches.patches[patch].corner_count == 4) << patch;
  }
}

TEST(Clusters, DrawPatchesByArea) {
  const Patches patches = RoomWithSphere();
  const Clusters clusters(patches);
  std::vector<double> found(patches.patches.size(), 0);
  constexpr int kPoints = 100'000;
  for (int k = 0; k < kPoints; ++k) {
    double u = (k + 0.5) / kPoints;
    found[clusters.PatchAt(0, u)] += 1.0 / kPoints;
    EXPECT_GE(u, 0);
    EXPECT_LT(u, 1);
  }
  for (Index patch = 0; patch < patches.patches.size(); ++patch) {
    EXPECT_NEAR(found[patch], patches.patches[patch].area / patches.area, 2.0 / kPoints);
  }
}

TEST(CosineBasis, IsAClampedCosineWithinATenthAndInTheMeanExactly) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  const auto direction = [&] { return Vec3(normal(random), normal(random), normal(random)).normalized(); };
  double sum = 0;
  double exact = 0;
  for (int k = 0; k < 10'000; ++k) {
    const Vec3 n = direction();
    const Vec3 w = direction();
    const double value = Evaluate(CosineBasis(n), CosineBasis(w));
    EXPECT_NEAR(value, std::max(0.0, n.dot(w)), 0.1);
    sum += value;
    exact += std::max(0.0, n.dot(w));
  }
  EXPECT_NEAR(sum, exact, 0.01 * exact);
}

}  // namespace
}  // namespace radbake
