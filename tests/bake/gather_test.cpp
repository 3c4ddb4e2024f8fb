/// The final gather along links.
#include "solver/bake/gather.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "solver/bake/element_centre.h"
#include "tests/solve/solved_scene_test.h"
#include "tests/test_scenes.h"

namespace radbake {
namespace {

using testing::SolvedScene;

SolveOptions FewLinks() {
  SolveOptions options;
  options.w_min = 1e-2;
  options.a_min = 1e-2;
  return options;
}

TEST(Gather, LetsNoSkyInThroughTheCornersOfAClosedRoom) {
  Scene scene = testing::ShadowRoom();
  scene.environment = Rgb::Constant(1e6);
  SolvedScene solved(scene, FewLinks());
  GatherOptions options;
  options.rays = 4;
  const Gatherer gatherer(solved.hierarchy, solved.solution.light, solved.solution.links, solved.visibility,
                          options);
  double brightest = 0;
  for (Index e = 0; e < solved.hierarchy.surface_root_count(); ++e) {
    brightest = std::max(brightest, Luminance(solved.solution.light.irradiance[e]));
  }
  // The six walls.
  for (Index wall = 0; wall < 6; ++wall) {
    for (int c = 0; c < 4; ++c) {
      const Vec3 x = InsideNear(solved.hierarchy, wall, solved.hierarchy.Shape(wall)[c]);
      const Index leaf = gatherer.SolverLeaf(wall, x);
      for (std::uint64_t key = 0; key < 64; ++key) {
        EXPECT_LT(Luminance(gatherer.Irradiance(x, leaf, key).irradiance), 10 * brightest)
            << wall << ", corner " << c << ", key " << key;
      }
    }
  }
}

}  // namespace
}  // namespace radbake
