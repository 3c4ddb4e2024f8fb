#include "solver/transport/zones.h"

#include <gtest/gtest.h>

#include <set>

#include "tests/test_scenes.h"

namespace radbake {
namespace {

/// The zones of the surfaces from `begin` to before `end`.
std::set<Index> ZonesOf(const Patches& patches, const std::vector<Index>& zones, Index begin, Index end) {
  std::set<Index> found;
  for (Index p = 0; p < patches.surface_patches; ++p) {
    if (patches.patches[p].surface >= begin && patches.patches[p].surface < end) {
      found.insert(zones[p]);
    }
  }
  return found;
}

struct BoxInABox {
  BoxInABox() {
    const Index grey = testing::AddMaterial(scene, 0.5, 1);
    testing::AddBox(scene, grey, Vec3(0, 0, 0), Vec3(2, 2, 2), true);
    inside = static_cast<Index>(scene.surfaces.size());
    testing::AddBox(scene, grey, Vec3(-0.1, -0.1, -0.1), Vec3(2.1, 2.1, 2.1), false);
    all = static_cast<Index>(scene.surfaces.size());
  }
  Scene scene;
  Index inside = 0;  // surfaces before
  Index all = 0;
};

TEST(Zones, AreTheInsideOfAClosedBoxAndWhatIsAroundIt) {
  BoxInABox boxes;
  testing::AddBox(boxes.scene, 0, Vec3(-1, -1, -1), Vec3(3, 3, 3), true);
  const auto end = static_cast<Index>(boxes.scene.surfaces.size());
  const Patches patches = CutIntoPatches(boxes.scene);
  const std::vector<Index> zones = FindZones(patches, Visibility(patches));
  ASSERT_EQ(zones.size(), patches.surface_patches);
  EXPECT_EQ(ZonesOf(patches, zones, 0, boxes.inside), std::set<Index>{1});
  EXPECT_EQ(ZonesOf(patches, zones, boxes.inside, end), std::set<Index>{0});
}

TEST(Zones, HoldAllThatSeesTheSky) {
  BoxInABox boxes;
  const auto zones = [&] {
    const Patches patches = CutIntoPatches(boxes.scene);
    return ZonesOf(patches, FindZones(patches, Visibility(patches)), boxes.inside, boxes.all);
  };
  // The sides of a convex body see nothing of one another.
  EXPECT_EQ(zones().size(), 6U);
  boxes.scene.environment = Rgb::Constant(1);
  EXPECT_EQ(zones().size(), 1U);
}

TEST(Zones, AreOneWhereLightGoesOnlyByWayOfOthers) {
  Scene scene = testing::ShadowRoom();
  const Patches patches = CutIntoPatches(scene);
  const std::vector<Index> zones = FindZones(patches, Visibility(patches));
  EXPECT_EQ(std::set<Index>(zones.begin(), zones.end()), std::set<Index>{0});
}

}  // namespace
}  // namespace radbake
