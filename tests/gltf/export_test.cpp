#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/gltf/builder_test.h"

namespace radbake::gltf {
namespace {

using testing::ElementsAre;
using testing::FloatEq;

TEST(Export, WritesWhatReadIrradianceReadsForEachRealScene) {
  for (const char* name : {"cornell-box-bevy", "living-room", "spheres-room"}) {
    const Document document(ReadSource(std::string(RADBAKE_SOURCE_DIR "/../shared/scenes/") + name + ".glb"));
    const Scene& scene = document.scene();
    const std::string glb = document.Export(TrivialBake(scene, 7));
    const BakedTriangles read = ReadIrradiance(Source{glb, {}});
    std::size_t t = 0;
    for (const Surface& surface : scene.surfaces) {
      const bool both = scene.materials[surface.material].sides == Sides::kBoth;
      t += surface.triangles.size() * (both ? 2 : 1);
    }
    EXPECT_EQ(read.triangles.size(), t) << name;
    EXPECT_TRUE((read.irradiance.front() == 7).all());
  }
}

}  // namespace
}  // namespace radbake::gltf
