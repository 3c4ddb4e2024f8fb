#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/gltf/builder_test.h"

namespace radbake::gltf {
namespace {

using testing::Contains;
using testing::Each;
using testing::ElementsAre;
using testing::FloatEq;
using testing::Not;

const Json& Primitive(const Unpacked& file, std::size_t mesh = 0, std::size_t primitive = 0) {
  return file.root["meshes"][mesh]["primitives"][primitive];
}

/// One triangle with a grey material.
Builder Grey() {
  Builder builder = OneTriangle();
  builder.Add("materials",
              {{"name", "grey"},
               {"pbrMetallicRoughness", {{"baseColorFactor", {0.5, 0.5, 0.5, 1}}, {"metallicFactor", 0}}}});
  builder.root["meshes"][0]["primitives"][0]["material"] = 0;
  return builder;
}

Unpacked Bake(const Builder& builder, float lux = 1, double exposure = 1) {
  const Document document = Open(builder);
  BakedScene baked = TrivialBake(document.scene(), lux);
  baked.exposure = exposure;
  return Unpacked(document.Export(baked));
}

TEST(Export, IsReadBackAsItWasBaked) {
  for (const char* name : {"cornell-box-bevy", "living-room", "spheres-room"}) {
    const Document document(ReadSource(RADBAKE_SOURCE_DIR "/../shared/scenes/" + std::string(name) + ".glb"));
    const Scene& scene = document.scene();
    const BakedScene baked = TrivialBake(scene, 7);
    const std::string glb = document.Export(baked);
    EXPECT_EQ(glb, document.Export(baked)) << "the same bytes again";
    const BakedTriangles read = ReadIrradiance(Source{glb, {}});
    EXPECT_THAT(read.irradiance, Each(testing::Truly([](const Rgb& lux) { return (lux == 7).all(); })));

    // Every triangle is there again, at the same place in the world and facing the same way.
    std::vector<std::array<double, 9>> expected;
    std::vector<std::array<double, 9>> found;
    const auto corners = [](const std::vector<Vec3>& positions, const Triangle& triangle) {
      std::array<double, 9> values{};
      for (std::size_t i = 0; i < 9; ++i) {
        values[i] = positions[triangle[i / 3]][static_cast<Eigen::Index>(i % 3)];
      }
      return values;
    };
    for (std::size_t s = 0; s < scene.surfaces.size(); ++s) {
      for (const BakedMesh* side : {&baked.surfaces[s].front, &baked.surfaces[s].back}) {
        for (const Triangle& triangle : side->triangles) {
          expected.push_back(corners(scene.surfaces[s].positions, triangle));
        }
      }
    }
    found.reserve(read.triangles.size());
    for (const Triangle& triangle : read.triangles) {
      found.push_back(corners(read.positions, triangle));
    }
    std::sort(expected.begin(), expected.end());
    std::sort(found.begin(), found.end());
    EXPECT_TRUE(expected == found) << name;
  }
}

TEST(Export, ShowsIrradianceThroughAnUnlitMaterial) {
  const Unpacked file = Bake(Grey(), 2, 0.25);
  const Json& attributes = Primitive(file)["attributes"];
  EXPECT_THAT(file.Element(attributes["_IRRADIANCE"], 2), ElementsAre(2, 2, 2));
  EXPECT_THAT(file.Element(attributes["COLOR_0"], 2), Each(FloatEq(0.5F / std::numbers::pi_v<float>)));
  EXPECT_EQ(file.root["materials"], Json::parse(R"([{"name":"grey","extensions":{"KHR_materials_unlit":{}},
      "pbrMetallicRoughness":{"baseColorFactor":[0.5,0.5,0.5,1],"metallicFactor":0}}])"));
  EXPECT_EQ(file.root["extensionsUsed"], Json::parse(R"(["KHR_materials_unlit"])"));
  EXPECT_EQ(file.root["accessors"][attributes["POSITION"].get<std::size_t>()]["max"], Json::parse("[1,1,0]"));
}

TEST(Export, ClampsTheColourAndNotTheIrradiance) {
  const Unpacked file = Bake(Grey(), 1000);
  EXPECT_THAT(file.Element(Primitive(file)["attributes"]["COLOR_0"], 0), ElementsAre(1, 1, 1));
  EXPECT_THAT(file.Element(Primitive(file)["attributes"]["_IRRADIANCE"], 0), ElementsAre(1000, 1000, 1000));
}

TEST(Export, MakesEmittersLookLit) {
  Builder builder = Grey();
  Json& material = builder.root["materials"][0];
  material["emissiveFactor"] = {1, 0.5, 0};
  material["emissiveTexture"] = {{"index", 0}};
  material["extensions"] = {{"KHR_materials_emissive_strength", {{"emissiveStrength", 4}}}};
  material["pbrMetallicRoughness"]["baseColorTexture"] = {{"index", 0}};
  material["pbrMetallicRoughness"]["baseColorFactor"] = {0.5, 0.5, 0.5, 0.75};
  builder.Add("textures", Json::object());
  const Unpacked file = Bake(builder, std::numbers::pi_v<float>, 0.1);
  // (L_e + ρE/π) × exposure, on white.
  EXPECT_THAT(file.Element(Primitive(file)["attributes"]["COLOR_0"], 0),
              ElementsAre(FloatEq(0.45F), FloatEq(0.25F), FloatEq(0.05F)));
  EXPECT_EQ(file.root["materials"][0], Json::parse(R"({"name":"grey","extensions":{"KHR_materials_unlit":{}},
      "pbrMetallicRoughness":{"baseColorFactor":[1,1,1,0.75],"metallicFactor":0}})"));
}

TEST(Export, KeepsEverythingThatABakeDoesNotTouch) {
  Builder builder = Grey();
  const Json extras =
      Json::parse(R"({"big":9007199254740993,"none":null,"empty":{},"tenth":0.1,"unicode":"žluť"})");
  builder.root["asset"]["generator"] = "by hand";
  builder.root["asset"]["extras"] = extras;
  builder.root["extensionsUsed"] = {"KHR_materials_ior"};
  builder.root["unknown"] = extras;
  builder.root["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 0.5}, {"znear", 0.01}}}}};
  builder.root["nodes"] = {{{"name", "root"}, {"children", {1, 2}}, {"extras", extras}},
                           {{"mesh", 0}, {"name", "sheet"}, {"translation", {1, 2, 3}}},
                           {{"camera", 0}}};
  builder.root["meshes"][0]["name"] = "sheet";
  builder.root["meshes"][0]["primitives"][0]["extras"] = extras;
  builder.root["materials"][0]["extensions"] = {{"KHR_materials_ior", {{"ior", 1.4}}}};
  const std::size_t times = builder.Floats({0, 1}, "SCALAR", 1);
  const std::size_t moves = builder.Vec3s({1, 2, 3, 4, 5, 6});
  builder.Add("animations",
              {{"name", "move"},
               {"samplers", {{{"input", times}, {"output", moves}}}},
               {"channels", {{{"sampler", 0}, {"target", {{"node", 1}, {"path", "translation"}}}}}}});
  const std::string image = "\x89PNG\r\n\x1A\n and so on";
  const std::size_t image_view = builder.View(std::vector<char>(image.begin(), image.end()));
  builder.Add("images", {{"bufferView", image_view}, {"mimeType", "image/png"}});
  const Json before = builder.root;
  const Unpacked file = Bake(builder);

  for (const char* key : {"asset", "unknown", "cameras", "nodes", "scene", "scenes"}) {
    EXPECT_EQ(file.root[key], before[key]) << key;
  }
  EXPECT_EQ(file.root["meshes"][0]["name"], "sheet");
  EXPECT_EQ(Primitive(file)["extras"], extras);
  EXPECT_EQ(file.root["materials"][0]["extensions"]["KHR_materials_ior"]["ior"], 1.4);
  EXPECT_EQ(file.root["animations"][0]["channels"], before["animations"][0]["channels"]);
  EXPECT_THAT(file.Element(file.root["animations"][0]["samplers"][0]["input"], 1), ElementsAre(1));
  EXPECT_THAT(file.Element(file.root["animations"][0]["samplers"][0]["output"], 1), ElementsAre(4, 5, 6));
  const Json& view = file.root["bufferViews"][file.root["images"][0]["bufferView"].get<std::size_t>()];
  EXPECT_EQ(file.binary.substr(view["byteOffset"], view["byteLength"]), image);
}

TEST(Export, DropsDataThatNothingUsesAnyMore) {
  const Unpacked file = Bake(Grey());
  EXPECT_EQ(file.root["accessors"].size(), 4U);    // three attributes and the indices
  EXPECT_EQ(file.root["bufferViews"].size(), 4U);  // and nothing of the old one
  EXPECT_EQ(file.root["buffers"], Json::parse(R"([{"byteLength":114}])"));
}

TEST(Export, KeepsTheNumbersOfAccessorsThatAnUnknownExtensionMayUse) {
  Builder builder = Grey();
  builder.root["nodes"][0]["extensions"] = {{"ACME_physics", {{"hull", 0}}}};
  const Unpacked file = Bake(builder);
  EXPECT_EQ(file.root["nodes"][0]["extensions"]["ACME_physics"]["hull"], 0);
  EXPECT_THAT(file.Element(0, 1), ElementsAre(1, 0, 0)) << "accessor 0 holds the old positions";
}

TEST(Export, CopiesNoSharedByteTwice) {
  Builder builder = Grey();
  Json root = builder.Root();
  // Two hundred views of one long part, under two names of one URI, all in use by images.
  root["buffers"][0]["uri"] = "part.bin";
  root["buffers"].push_back(root["buffers"][0]);
  const std::string part = builder.binary + std::string(100'000, 'x');
  root["buffers"][0]["byteLength"] = part.size();
  root["buffers"][1]["byteLength"] = part.size();
  for (int i = 0; i < 200; ++i) {
    root["bufferViews"].push_back({{"buffer", i % 2}, {"byteOffset", i}, {"byteLength", 90'000}});
    root["images"].push_back({{"bufferView", i + 1}, {"mimeType", "image/png"}});
  }
  const Document document(Source{root.dump(), {{"part.bin", part}}});
  const std::string glb = document.Export(TrivialBake(document.scene()));
  EXPECT_LT(glb.size(), 150'000U);
  const Unpacked file(glb);
  const Json& view = file.root["bufferViews"][file.root["images"][133]["bufferView"].get<std::size_t>()];
  EXPECT_EQ(file.binary.substr(view["byteOffset"], view["byteLength"]), part.substr(133, 90'000));
}

TEST(Export, EmbedsBuffersAndImagesOfTheUpload) {
  Builder builder = Grey();
  Json root = builder.Root();
  root["buffers"][0]["uri"] = "mesh.bin";
  root["images"] = {{{"uri", "a.jpg"}}, {{"uri", "a.jpg"}}, {{"uri", "data:image/png;base64,AAAA"}}};
  const std::string jpeg = "\xFF\xD8\xFF and so on";
  const Document document(Source{root.dump(), {{"mesh.bin", builder.binary}, {"a.jpg", jpeg}}});
  const Unpacked file(document.Export(TrivialBake(document.scene())));
  EXPECT_FALSE(file.root["buffers"][0].contains("uri"));
  EXPECT_EQ(file.root["images"][0], file.root["images"][1]) << "one part is embedded once";
  EXPECT_EQ(file.root["images"][0]["mimeType"], "image/jpeg");
  EXPECT_EQ(file.root["images"][2], root["images"][2]);
  const Json& view = file.root["bufferViews"][file.root["images"][0]["bufferView"].get<std::size_t>()];
  EXPECT_EQ(file.binary.substr(view["byteOffset"], view["byteLength"]), jpeg);
}

TEST(Export, GivesEachInstanceAMeshOfItsOwn) {
  Builder builder = Grey();
  builder.Add("nodes", {{"mesh", 0}, {"translation", {5, 0, 0}}});
  builder.root["scenes"][0]["nodes"] = {0, 1};
  const Document document = Open(builder);
  BakedScene baked = TrivialBake(document.scene(), 3);
  for (BakedVertex& vertex : baked.surfaces[1].front.vertices) {
    vertex.irradiance.setConstant(4);
  }
  const Unpacked file(document.Export(baked));
  EXPECT_EQ(file.root["nodes"][0]["mesh"], 0);
  EXPECT_EQ(file.root["nodes"][1]["mesh"], 1);
  EXPECT_THAT(file.Element(Primitive(file, 0)["attributes"]["_IRRADIANCE"], 0), Each(3));
  EXPECT_THAT(file.Element(Primitive(file, 1)["attributes"]["_IRRADIANCE"], 0), Each(4));
  EXPECT_EQ(file.root["materials"].size(), 1U);
}

TEST(Export, LeavesAMeshThatAnotherNodeShowsAsItWas) {
  Builder builder = Grey();
  builder.Add("nodes", {{"mesh", 0}});  // not in the scene
  const Unpacked file = Bake(builder);
  EXPECT_EQ(file.root["nodes"][0]["mesh"], 1);
  EXPECT_EQ(file.root["nodes"][1]["mesh"], 0);
  EXPECT_EQ(Primitive(file, 0)["material"], 0);
  EXPECT_FALSE(file.root["materials"][0].contains("extensions"));
  EXPECT_EQ(Primitive(file, 1)["material"], 1);
  EXPECT_TRUE(file.root["materials"][1]["extensions"].contains("KHR_materials_unlit"));
}

TEST(Export, LeavesSurfacesThatAreNotBaked) {
  Builder builder = Grey();
  Json& primitives = builder.root["meshes"][0]["primitives"];
  builder.Add("materials", {{"extensions", {{"KHR_materials_unlit", Json::object()}}}});
  Json blocker = {{"attributes", {{"POSITION", 0}}}, {"material", 1}};
  Json points = {{"attributes", {{"POSITION", 0}}}, {"mode", 0}, {"material", 0}};
  primitives.push_back(blocker);
  primitives.push_back(points);
  const Unpacked file = Bake(builder);
  EXPECT_EQ(Primitive(file, 0, 1)["material"], 1);
  EXPECT_EQ(Primitive(file, 0, 2)["material"], 0) << "still lit";
  EXPECT_EQ(Primitive(file, 0, 2)["mode"], 0);
  EXPECT_EQ(Primitive(file, 0, 0)["material"], 2);
  EXPECT_THAT(file.Element(Primitive(file, 0, 1)["attributes"]["POSITION"], 1), ElementsAre(1, 0, 0));
}

TEST(Export, MakesADefaultMaterialExplicit) {
  const Unpacked file = Bake(OneTriangle());
  EXPECT_EQ(Primitive(file)["material"], 0);
  EXPECT_TRUE(file.root["materials"][0]["extensions"].contains("KHR_materials_unlit"));
}

TEST(Export, MakesTwoSidesOfADoubleSidedSurface) {
  Builder builder = Grey();
  builder.root["materials"][0]["doubleSided"] = true;
  Json& attributes = builder.root["meshes"][0]["primitives"][0]["attributes"];
  attributes["NORMAL"] = builder.Vec3s({0, 0, 1, 0, 0, 1, 0, 0, 1});
  attributes["TANGENT"] = builder.Floats({1, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0, 1}, "VEC4", 4);
  const Unpacked file = Bake(builder);
  ASSERT_EQ(file.root["meshes"][0]["primitives"].size(), 2U);
  EXPECT_THAT(file.Element(Primitive(file, 0, 0)["attributes"]["NORMAL"], 0), ElementsAre(0, 0, 1));
  EXPECT_THAT(file.Element(Primitive(file, 0, 1)["attributes"]["NORMAL"], 0), ElementsAre(0, 0, -1));
  EXPECT_THAT(file.Element(Primitive(file, 0, 0)["attributes"]["TANGENT"], 0), ElementsAre(1, 0, 0, 1));
  EXPECT_THAT(file.Element(Primitive(file, 0, 1)["attributes"]["TANGENT"], 0), ElementsAre(1, 0, 0, -1));
  EXPECT_EQ(Primitive(file, 0, 0)["material"], Primitive(file, 0, 1)["material"]);
  EXPECT_FALSE(file.root["materials"][0].contains("doubleSided"));
}

TEST(Export, WindsAMirroredNodeInTheSpaceOfItsMesh) {
  Builder builder = Grey();
  builder.root["nodes"][0]["scale"] = {-1, 1, 1};
  const Document document = Open(builder);
  const std::string glb = document.Export(TrivialBake(document.scene()));
  const BakedTriangles world = ReadIrradiance(Source{glb, {}});
  const Triangle& t = world.triangles.at(0);
  EXPECT_GT((world.positions[t[1]] - world.positions[t[0]])
                .cross(world.positions[t[2]] - world.positions[t[0]])
                .z(),
            0);
  EXPECT_EQ(Unpacked(glb).root["nodes"][0]["scale"], Json::parse("[-1,1,1]"));
}

TEST(Export, InterpolatesAttributesBetweenTheSources) {
  Builder builder = Grey();
  Json& attributes = builder.root["meshes"][0]["primitives"][0]["attributes"];
  const float s = std::sqrt(0.5F);
  attributes["NORMAL"] = builder.Vec3s({0, 0, 1, 0, 1, 0, 0, 0, 1});
  attributes["TEXCOORD_0"] =
      builder.Accessor(builder.View<std::uint16_t>({0, 0, 65535, 0, 0, 65535}), 5123, 3, "VEC2");
  builder.root["accessors"].back()["normalized"] = true;
  attributes["_HEAT"] = builder.Floats({0, 8, 0}, "SCALAR", 1);
  attributes["COLOR_0"] = builder.Vec3s({1, 0, 0, 1, 0, 0, 1, 0, 0});
  const Document document = Open(builder);
  BakedScene baked = TrivialBake(document.scene());
  BakedMesh& mesh = baked.surfaces[0].front;
  mesh.vertices.push_back({{0, 1, 0, 0}, {0.5F, 0.5F, 0, 0}, {9, 9, 9}});
  mesh.triangles = {{0, 3, 2}, {3, 1, 2}};
  const Unpacked file(document.Export(baked));
  const Json& made = Primitive(file)["attributes"];
  EXPECT_THAT(file.Element(made["POSITION"], 3), ElementsAre(0.5F, 0, 0));
  EXPECT_THAT(file.Element(made["NORMAL"], 3), ElementsAre(0, FloatEq(s), FloatEq(s)));
  EXPECT_THAT(file.Element(made["TEXCOORD_0"], 3), ElementsAre(0.5F, 0));
  EXPECT_THAT(file.Element(made["_HEAT"], 3), ElementsAre(4));
  EXPECT_THAT(file.Element(made["COLOR_0"], 3), Each(1)) << "the input's vertex colour gives way";
}

TEST(Export, DropsCompressedTwinsOfWhatItWrites) {
  Builder builder = Grey();
  builder.root["extensionsUsed"] = {"KHR_draco_mesh_compression", "EXT_meshopt_compression"};
  builder.root["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"] = {
      {"bufferView", 0}};
  const std::size_t times = builder.Floats({0, 1}, "SCALAR", 1);
  builder.root["bufferViews"].back()["extensions"]["EXT_meshopt_compression"] = {{"buffer", 0}};
  builder.Add("animations",
              {{"samplers", {{{"input", times}, {"output", times}}}}, {"channels", Json::array()}});
  const Unpacked file = Bake(builder);
  EXPECT_FALSE(Primitive(file).contains("extensions"));
  for (const Json& view : file.root["bufferViews"]) {
    EXPECT_FALSE(view.contains("extensions"));
  }
  EXPECT_THAT(file.root["extensionsUsed"], Not(Contains("EXT_meshopt_compression")));
  EXPECT_THAT(file.Element(file.root["animations"][0]["samplers"][0]["input"], 1), ElementsAre(1));
}

TEST(ReadIrradiance, RefusesAFileThatIsNotBaked) {
  EXPECT_THROW(ReadIrradiance(Source{Grey().Glb(), {}}), InputError);
}

TEST(ReadIrradiance, RefusesIrradianceOfAnotherType) {
  Builder builder = Grey();
  builder.root["meshes"][0]["primitives"][0]["attributes"]["_IRRADIANCE"] =
      builder.Floats({1, 2, 3}, "SCALAR", 1);
  EXPECT_THROW(ReadIrradiance(Source{builder.Glb(), {}}), InputError);
}

}  // namespace
}  // namespace radbake::gltf
