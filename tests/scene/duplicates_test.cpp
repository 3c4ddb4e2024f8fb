#include "solver/scene/duplicates.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/test_scenes.h"

namespace radbake {
namespace {

/// Two surfaces of one triangle, of the same corners in the given orders.
Scene Two(Sides first, Sides second, const Triangle& of_second) {
  Scene scene;
  scene.materials.resize(2);
  scene.materials[0].sides = first;
  scene.materials[1].sides = second;
  for (Index i = 0; i < 2; ++i) {
    Surface surface;
    surface.material = i;
    surface.positions = {{0, 0, 0}, {1, 0, -0.0}, {0, 1, 0}};
    surface.triangles = {i == 0 ? Triangle{0, 1, 2} : of_second};
    scene.surfaces.push_back(surface);
  }
  scene.surfaces[1].positions[1].z() = 0;
  return scene;
}

TEST(Duplicates, AreTrianglesThatTurnTheSameWay) {
  for (const Triangle& same : {Triangle{0, 1, 2}, Triangle{1, 2, 0}, Triangle{2, 0, 1}}) {
    Scene scene = Two(Sides::kFront, Sides::kFront, same);
    EXPECT_EQ(DropDuplicates(scene), 1U);
    EXPECT_EQ(scene.surfaces[0].triangles.size(), 1U);
    EXPECT_TRUE(scene.surfaces[1].triangles.empty());
  }
  for (const Triangle& turned : {Triangle{0, 2, 1}, Triangle{2, 1, 0}, Triangle{1, 0, 2}}) {
    Scene scene = Two(Sides::kFront, Sides::kFront, turned);
    EXPECT_EQ(DropDuplicates(scene), 0U);
  }
}

TEST(Duplicates, FaceNoWayThatTheFirstDoesNot) {
  const auto dropped = [](Sides first, Sides second, const Triangle& order) {
    Scene scene = Two(first, second, order);
    return DropDuplicates(scene) == 1;
  };
  EXPECT_TRUE(dropped(Sides::kBoth, Sides::kFront, {0, 1, 2}));
  EXPECT_TRUE(dropped(Sides::kBoth, Sides::kFront, {0, 2, 1}));
  EXPECT_TRUE(dropped(Sides::kBoth, Sides::kBoth, {0, 2, 1}));
  EXPECT_FALSE(dropped(Sides::kFront, Sides::kBoth, {0, 1, 2}));
  EXPECT_FALSE(dropped(Sides::kFront, Sides::kBoth, {0, 2, 1}));
}

TEST(Duplicates, HaveAllThreeCornersInCommon) {
  Scene scene = Two(Sides::kFront, Sides::kFront, {0, 1, 2});
  scene.surfaces[1].positions[2] = Vec3(0, 1 + 1e-15, 0);
  EXPECT_EQ(DropDuplicates(scene), 0U);
}

TEST(Duplicates, ThatAreManyLeaveOneEach) {
  Scene scene;
  testing::AddBox(scene, testing::AddMaterial(scene, 0.5, 1), Vec3(0, 0, 0), Vec3(1, 1, 1), true);
  const std::vector<Triangle> before = scene.surfaces[3].triangles;
  for (int i = 0; i < 100; ++i) {
    scene.surfaces[3].triangles.insert(scene.surfaces[3].triangles.begin() + i,
                                       before[static_cast<std::size_t>(i) % 2]);
  }
  EXPECT_EQ(DropDuplicates(scene), 100U);
  EXPECT_THAT(scene.surfaces[3].triangles, ::testing::UnorderedElementsAreArray(before));
}

}  // namespace
}  // namespace radbake
