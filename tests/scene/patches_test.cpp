#include "solver/scene/patches.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/test_scenes.h"

namespace radbake {
namespace {

TEST(Patches, MergeTheTrianglesOfAQuadrilateral) {
  const Patches patches = CutIntoPatches(testing::FurnaceBox(0.5));
  ASSERT_EQ(patches.patches.size(), 6U);
  for (const Patch& patch : patches.patches) {
    EXPECT_EQ(patch.corner_count, 4);
    EXPECT_NEAR(patch.area, 1, 1e-12);
  }
  EXPECT_EQ(patches.blockers.size(), 12U);
}

TEST(Patches, KeepTrianglesWhoseAttributesAreNotAffineOverTheQuadrilateral) {
  Scene scene = testing::FurnaceBox(0.5);
  scene.surfaces[0].attribute_width = 1;
  scene.surfaces[0].attributes = {0, 1, 0, 1};
  EXPECT_EQ(CutIntoPatches(scene).patches.size(), 7U);
  scene.surfaces[0].attributes = {0, 1, 1, 0};
  EXPECT_EQ(CutIntoPatches(scene).patches.size(), 6U);
}

TEST(Patches, DoNotMergeAcrossABendOrIntoAConcaveShape) {
  Scene scene = testing::FurnaceBox(0.5);
  scene.surfaces[0].positions[3] += Vec3(0, 0.01, 0);
  EXPECT_EQ(CutIntoPatches(scene).patches.size(), 7U);
  scene = testing::FurnaceBox(0.5);
  scene.surfaces[0].positions[1] = Vec3(0.4, 0, 0.5);
  scene.surfaces[0].triangles = {{0, 1, 3}, {1, 2, 3}};
  EXPECT_EQ(CutIntoPatches(scene).patches.size(), 6U);
  scene.surfaces[0].positions[1] = Vec3(0.6, 0, 0.4);  // beyond the diagonal: reflex
  EXPECT_EQ(CutIntoPatches(scene).patches.size(), 7U);
}

TEST(Patches, AreTheSameInMicrometresAndInKilometres) {
  Scene scene = testing::ShadowRoom();
  const Patches metres = CutIntoPatches(scene);
  for (Surface& surface : scene.surfaces) {
    for (Vec3& position : surface.positions) {
      position = position * 0x1p-20 + Vec3(0, 0, 0);
    }
  }
  for (Material& material : scene.materials) {
    material.emission *= 0x1p30;
  }
  const Patches micro = CutIntoPatches(scene);
  ASSERT_EQ(micro.patches.size(), metres.patches.size());
  for (std::size_t k = 0; k < micro.patches.size(); ++k) {
    EXPECT_EQ(micro.patches[k].corner, metres.patches[k].corner);
    EXPECT_TRUE((micro.patches[k].emission == metres.patches[k].emission).all());
  }
}

TEST(Patches, GiveADoubleSidedSurfaceTwoOppositeOnes) {
  Scene scene = testing::FurnaceBox(0.5);
  scene.materials[0].sides = Sides::kBoth;
  const Patches patches = CutIntoPatches(scene);
  ASSERT_EQ(patches.patches.size(), 12U);
  EXPECT_EQ(patches.patches[0].normal, -patches.patches[1].normal);
  EXPECT_FALSE(patches.patches[0].back);
  EXPECT_TRUE(patches.patches[1].back);
  EXPECT_EQ(patches.blockers.size(), 12U);
  EXPECT_EQ(patches.blockers[0].front, 0U);
  EXPECT_EQ(patches.blockers[0].back, 1U);
}

TEST(Patches, LeaveOutTrianglesWithoutArea) {
  Scene scene = testing::FurnaceBox(0.5);
  scene.surfaces[0].triangles.push_back({0, 0, 1});
  scene.surfaces[0].positions.emplace_back(scene.surfaces[0].positions[0] * 2 -
                                           scene.surfaces[0].positions[1]);
  scene.surfaces[0].triangles.push_back({0, 1, 4});  // three in a row
  EXPECT_EQ(CutIntoPatches(scene).blockers.size(), 12U);
}

TEST(Patches, RefuseASceneThatNothingLights) {
  Scene scene = testing::FurnaceBox(0.5);
  scene.materials[0].emission = Rgb::Zero();
  try {
    CutIntoPatches(scene);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("nothing in the scene emits light"));
  }
}

}  // namespace
}  // namespace radbake
