#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "tests/cli/run_radbake.h"

namespace radbake {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::IsOneLine;
using testing::Outcome;
using testing::SceneFile;
using ::testing::StartsWith;

class CheckCommand : public testing::RadbakeTest {
 protected:
  void BakeFurnace() const {
    const Outcome run =
        Radbake({"bake", SceneFile("furnace-box.glb"), "-o", File("baked.glb"), "--check", "0"});
    ASSERT_EQ(run.code, 0) << run.error;
  }
};

TEST_F(CheckCommand, PrintsTheMeasuredError) {
  BakeFurnace();
  const Outcome run = Radbake({"check", SceneFile("furnace-box.glb"), File("baked.glb"), "--probes", "64"});
  EXPECT_EQ(run.code, 0) << run.error;
  EXPECT_THAT(run.out, AllOf(StartsWith("relative RMS error"), HasSubstr("95 %"), HasSubstr("bias"),
                             HasSubstr("missing 0 % of 64 probes"), HasSubstr("rays")));
}

TEST_F(CheckCommand, PrintsTheSameAsJson) {
  BakeFurnace();
  const Outcome run =
      Radbake({"check", SceneFile("furnace-box.glb"), File("baked.glb"), "--probes", "64", "--json"});
  ASSERT_EQ(run.code, 0) << run.error;
  const json measured = json::parse(run.out);
  EXPECT_EQ(measured["probes"], 64);
  EXPECT_EQ(measured["missing"], 0);
  EXPECT_LE(measured["low"], measured["relative_rms"]);
  EXPECT_GE(measured["high"], measured["relative_rms"]);
  EXPECT_LT(measured["relative_rms"], 0.02);
}

TEST_F(CheckCommand, MeasuresUnderTheSkyThatItIsTold) {
  // One triangle, which the sky lights with π·L, under a bake that says so.
  Write("scene.gltf",
        R"({"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "_IRRADIANCE": 1}}]}],
            "buffers": [{"byteLength": 72, "uri": "scene.bin"}],
            "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 36}],
            "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
                          {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC3"}]})");
  std::string bytes;
  for (const float number : {0.F, 0.F, 0.F, 1.F, 0.F, 0.F, 0.F, 1.F, 0.F, 6.28318531F, 0.F, 0.F, 6.28318531F,
                             0.F, 0.F, 6.28318531F, 0.F, 0.F}) {
    bytes.append(reinterpret_cast<const char*>(&number), sizeof(number));
  }
  Write("scene.bin", bytes);
  const Outcome run = Radbake({"check", File("scene.gltf"), File("scene.gltf"), "--probes", "16", "--json",
                               "--environment.radiance", "[2, 0, 0]"});
  ASSERT_EQ(run.code, 0) << run.error;
  EXPECT_LT(json::parse(run.out)["relative_rms"], 0.02);
}

TEST_F(CheckCommand, SaysWhenTheBakeIsOfAnotherScene) {
  BakeFurnace();
  const Outcome run = Radbake({"check", SceneFile("two-rooms.glb"), File("baked.glb"), "--probes", "64"});
  EXPECT_EQ(run.code, 1);
  EXPECT_TRUE(IsOneLine(run.error)) << run.error;
  EXPECT_THAT(run.error, AllOf(StartsWith("radbake: "), HasSubstr("is not a bake of")));
}

TEST_F(CheckCommand, RefusesBadUsageInOneLineWithExitCodeTwo) {
  const std::string scene = SceneFile("furnace-box.glb");
  struct Case {
    std::vector<std::string> arguments;
    const char* named;
  };
  for (const Case& one : std::initializer_list<Case>{
           {{"check"}, "SCENE"},
           {{"check", scene}, "BAKED"},
           {{"check", scene, File("none.glb")}, "none.glb"},
           {{"check", scene, scene}, "_IRRADIANCE"},
           {{"check", scene, scene, "--probes", "0"}, "--probes"},
           {{"check", scene, scene, "--probes", "many"}, "--probes"},
           {{"check", scene, scene, "--environment.radiance", "[1, 1]"}, "environment.radiance"},
       }) {
    const Outcome run = Radbake(one.arguments);
    EXPECT_EQ(run.code, 2) << one.named;
    EXPECT_TRUE(IsOneLine(run.error)) << run.error;
    EXPECT_THAT(run.error, AllOf(StartsWith("radbake: "), HasSubstr(one.named)));
  }
}

}  // namespace
}  // namespace radbake
