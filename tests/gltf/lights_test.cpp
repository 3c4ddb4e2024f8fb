#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <numbers>

#include "tests/gltf/builder_test.h"

namespace radbake::gltf {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::Not;

/// OneTriangle() with a light at node 1, which stands in the scene.
Builder WithLight(const Json& light, const Json& node = Json::object()) {
  Builder builder = OneTriangle();
  builder.root["extensionsUsed"] = {"KHR_lights_punctual"};
  builder.root["extensions"]["KHR_lights_punctual"]["lights"] = Json::array({light});
  builder.Add("nodes", node);
  builder.root["nodes"][1]["extensions"]["KHR_lights_punctual"]["light"] = 0;
  builder.root["scenes"][0]["nodes"] = {0, 1};
  return builder;
}

PunctualLight Imported(const Json& light, const Json& node = Json::object()) {
  const Document document = Open(WithLight(light, node));
  EXPECT_EQ(document.scene().lights.size(), 1U);
  return document.scene().lights.at(0);
}

TEST(Lights, APointLightHasItsDefaults) {
  const PunctualLight light = Imported({{"type", "point"}});
  EXPECT_EQ(light.kind, PunctualLight::Kind::kPoint);
  EXPECT_EQ(light.name, "node 1 light 0");
  EXPECT_EQ(light.position, Vec3::Zero());
  EXPECT_TRUE((light.intensity == 1).all());
  EXPECT_EQ(light.range, std::numeric_limits<double>::infinity());
}

TEST(Lights, ItsIntensityIsColorTimesIntensity) {
  const PunctualLight light = Imported({{"type", "point"}, {"color", {1, 0.5, 0}}, {"intensity", 40}});
  EXPECT_TRUE((light.intensity == Rgb(40, 20, 0)).all());
}

TEST(Lights, ASpotWithoutAnglesHasTheDefaultCones) {
  for (const Json& json : {Json{{"type", "spot"}}, Json{{"type", "spot"}, {"spot", Json::object()}}}) {
    const PunctualLight light = Imported(json);
    EXPECT_EQ(light.kind, PunctualLight::Kind::kSpot);
    EXPECT_EQ(light.inner_cosine, 1);
    EXPECT_NEAR(light.outer_cosine, std::sqrt(0.5), 1e-15);
  }
}

TEST(Lights, ASpotHasItsConesAndRange) {
  const PunctualLight light = Imported(
      {{"type", "spot"},
       {"range", 7},
       {"spot", {{"innerConeAngle", std::numbers::pi / 6}, {"outerConeAngle", std::numbers::pi / 3}}}});
  EXPECT_NEAR(light.inner_cosine, std::sqrt(0.75), 1e-15);
  EXPECT_NEAR(light.outer_cosine, 0.5, 1e-15);
  EXPECT_EQ(light.range, 7);
}

TEST(Lights, ConesAsExportersRoundThemAreTaken) {
  // Equal ones, and a right angle in single precision, which is more than π/2.
  const double right = std::numbers::pi_v<float> / 2;
  ASSERT_GT(right, std::numbers::pi / 2);
  const PunctualLight light =
      Imported({{"type", "spot"}, {"spot", {{"innerConeAngle", right}, {"outerConeAngle", right}}}});
  EXPECT_NEAR(light.outer_cosine, 0, 1e-7);
  EXPECT_EQ(light.inner_cosine, light.outer_cosine);
}

TEST(Lights, ADirectionalLightHasNoRange) {
  const PunctualLight light = Imported({{"type", "directional"}, {"range", 2}, {"intensity", 1000}});
  EXPECT_EQ(light.kind, PunctualLight::Kind::kDirectional);
  EXPECT_EQ(light.direction, -Vec3::UnitZ());
  EXPECT_TRUE((light.intensity == 1000).all());
  EXPECT_EQ(light.range, std::numeric_limits<double>::infinity());
}

TEST(Lights, StandAndLookAsTheirNodeDoes) {
  // A quarter turn about x takes −z to y; the parents scale unevenly, and move.
  Builder builder = WithLight({{"type", "spot"}, {"range", 3}, {"name", "lamp"}},
                              {{"name", "pole"}, {"translation", {1, 2, 3}}, {"scale", {2, 5, 7}}});
  builder.root["nodes"][1].erase("extensions");
  builder.root["nodes"][1]["children"] = {2};
  builder.Add("nodes", {{"name", "arm"},
                        {"rotation", {std::sqrt(0.5), 0, 0, std::sqrt(0.5)}},
                        {"translation", {1, 1, 1}},
                        {"scale", {1, 1, 100}},
                        {"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  const Document document = Open(builder);
  const PunctualLight& light = document.scene().lights.at(0);
  EXPECT_EQ(light.name, "node 'arm' light 'lamp'");
  EXPECT_TRUE(light.position.isApprox(Vec3(3, 7, 10), 1e-12)) << light.position.transpose();
  EXPECT_TRUE(light.direction.isApprox(Vec3::UnitY(), 1e-12)) << light.direction.transpose();
  EXPECT_EQ(light.range, 3);
}

TEST(Lights, StandOnceForEveryNodeOfTheSceneThatUsesThem) {
  Builder builder = WithLight({{"type", "point"}});
  for (const int x : {5, 6}) {
    builder.Add("nodes",
                {{"translation", {x, 0, 0}}, {"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  }
  builder.root["scenes"][0]["nodes"] = {0, 1, 2};  // node 3 is in no scene
  const Document document = Open(builder);
  ASSERT_EQ(document.scene().lights.size(), 2U);
  EXPECT_EQ(document.scene().lights[1].position, Vec3(5, 0, 0));
}

TEST(Lights, OfNoIntensityAreLeftOut) {
  EXPECT_TRUE(Open(WithLight({{"type", "point"}, {"intensity", 0}})).scene().lights.empty());
  EXPECT_TRUE(Open(WithLight({{"type", "point"}, {"color", {0, 0, 0}}})).scene().lights.empty());
}

TEST(Lights, WithoutADirectionAreNamedAsIgnored) {
  const Document flat = Open(WithLight({{"type", "directional"}}, {{"scale", {1, 1, 0}}}));
  EXPECT_TRUE(flat.scene().lights.empty());
  ASSERT_EQ(flat.scene().ignored.size(), 1U);
  EXPECT_EQ(flat.scene().ignored[0].feature, "node 1 light 0");
  EXPECT_THAT(flat.scene().warnings, Contains(HasSubstr("node 1 light 0")));
  // A point light needs none.
  EXPECT_EQ(Open(WithLight({{"type", "point"}}, {{"scale", {0, 0, 0}}})).scene().lights.size(), 1U);
}

TEST(Lights, SurviveTheBake) {
  const Builder builder = WithLight({{"type", "point"}, {"name", "lamp"}});
  const Document document = Open(builder);
  const Unpacked baked(document.Export(TrivialBake(document.scene())));
  EXPECT_EQ(baked.root["extensions"]["KHR_lights_punctual"],
            builder.root["extensions"]["KHR_lights_punctual"]);
  EXPECT_EQ(baked.root["nodes"][1]["extensions"]["KHR_lights_punctual"]["light"], 0);
}

TEST(Lights, WithValuesOutOfRangeAreRefusedByTheirNumber) {
  const Json spot = {{"type", "spot"}};
  const auto with = [](Json json, const Json& more) {
    json.update(more);
    return json;
  };
  const auto cones = [&](const Json& angles) { return with(spot, {{"spot", angles}}); };
  struct Case {
    Json light;
    const char* message;
  };
  for (const Case& one : std::initializer_list<Case>{
           {Json::object(), "light 0: type is neither"},
           {{{"type", "area"}}, "light 0: type is neither"},
           {{{"type", 1}}, "light 0: type is not a text"},
           {with(spot, {{"name", 1}}), "light 0: name is not a text"},
           {with(spot, {{"intensity", -1}}), "light 0: color or intensity is negative"},
           {with(spot, {{"intensity", nullptr}}), "light 0: intensity is not a number"},
           {with(spot, {{"intensity", 1e19}}), "light 0: color or intensity is negative or too large"},
           {with(spot, {{"intensity", 1e10}, {"color", {1, 1, 1e10}}}), "light 0: color or intensity"},
           {with(spot, {{"color", {1, -0.1, 1}}}), "light 0: color or intensity is negative"},
           {with(spot, {{"color", {1, 1}}}), "light 0: color is not a list of 3 numbers"},
           {with(spot, {{"range", 0}}), "light 0: range is not above 0"},
           {with(spot, {{"range", -5}}), "light 0: range is not above 0"},
           {with(spot, {{"range", "far"}}), "light 0: range is not a number"},
           {with(spot, {{"spot", 3}}), "light 0: spot is not an object"},
           {cones({{"outerConeAngle", 0}}), "light 0: outerConeAngle"},
           {cones({{"outerConeAngle", 1.58}}), "light 0: outerConeAngle"},
           {cones({{"innerConeAngle", -0.1}}), "light 0: innerConeAngle"},
           {cones({{"innerConeAngle", 0.8}}), "light 0: innerConeAngle"},
           {cones({{"innerConeAngle", 0.5}, {"outerConeAngle", 0.4}}), "light 0: innerConeAngle"},
       }) {
    try {
      const Document document = Open(WithLight(one.light));
      ADD_FAILURE() << "taken, and not refused with: " << one.message;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(one.message));
      EXPECT_THAT(error.what(), Not(HasSubstr("\n")));
    }
  }
}

TEST(Lights, BeyondTheListAreRefusedWithTheirNode) {
  Builder builder = WithLight({{"type", "point"}});
  builder.root["nodes"][1]["extensions"]["KHR_lights_punctual"]["light"] = 1;
  EXPECT_THAT([&] { Open(builder); },
              testing::ThrowsMessage<InputError>(HasSubstr("node 1: light 1 is beyond the 1")));
  // In no scene, but wrong.
  builder.root["scenes"][0]["nodes"] = {0};
  EXPECT_THROW(Open(builder), InputError);
  builder.root["extensions"]["KHR_lights_punctual"]["lights"] = "many";
  EXPECT_THAT([&] { Open(builder); }, testing::ThrowsMessage<InputError>(HasSubstr("lights is not a list")));
}

TEST(Environment, IsSetFromOutside) {
  Document document = Open(OneTriangle());
  EXPECT_TRUE((document.scene().environment == 0).all());
  document.SetEnvironment(Rgb(1, 2, 3));
  EXPECT_TRUE((document.scene().environment == Rgb(1, 2, 3)).all());
}

}  // namespace
}  // namespace radbake::gltf
