#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/gltf/builder_test.h"

namespace radbake::gltf {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::Field;
using testing::HasSubstr;

/// Twice the area vector of a triangle: its direction is that of the front.
Vec3 Front(const Surface& surface, std::size_t triangle) {
  const Triangle& t = surface.triangles[triangle];
  return (surface.positions[t[1]] - surface.positions[t[0]])
      .cross(surface.positions[t[2]] - surface.positions[t[0]]);
}

/// OneTriangle() with a material.
Builder WithMaterial(Json material) {
  Builder builder = OneTriangle();
  builder.Add("materials", std::move(material));
  builder.root["meshes"][0]["primitives"][0]["material"] = 0;
  return builder;
}

TEST(Import, ReadsTheRealScenes) {
  const std::vector<std::pair<std::string, std::size_t>> scenes = {
      {"cornell-box-bevy", 36}, {"living-room", 1519}, {"spheres-room", 63720}};
  for (const auto& [name, expected] : scenes) {
    const Document document(ReadSource(RADBAKE_SOURCE_DIR "/../shared/scenes/" + name + ".glb"));
    std::size_t triangles = 0;
    for (const Surface& surface : document.scene().surfaces) {
      EXPECT_EQ(surface.normals.size(), surface.positions.size());
      EXPECT_EQ(surface.attributes.size(), surface.positions.size() * surface.attribute_width);
      for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
        // More than two thirds of the living room's triangles have no area, and 32 are duplicates.
        triangles += Front(surface, t).norm() > 0 ? 1U : 0U;
        // Normals agree with the winding, so both were brought to the world alike.
        EXPECT_GE(Front(surface, t).dot(surface.normals[surface.triangles[t][0]]), -1e-6) << surface.name;
      }
    }
    EXPECT_EQ(triangles, expected) << name;
  }
}

TEST(Import, TurnsTheWindingOfAMirroredNode) {
  Builder builder = OneTriangle();
  builder.root["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] =
      builder.Vec3s({0, 0, 1, 0, 0, 1, 0, 0, 1});
  builder.root["nodes"][0]["scale"] = {-2, 1, 1};
  const Document document = Open(builder);
  const Surface& surface = document.scene().surfaces.at(0);
  // The mirrored sheet still faces +z, where its normals point.
  EXPECT_EQ(Front(surface, 0), Vec3(0, 0, 2));
  EXPECT_EQ(surface.normals.at(0), Vec3(0, 0, 1));
  EXPECT_EQ(surface.positions.at(1), Vec3(-2, 0, 0));
}

TEST(Import, TurnsNormalsWithTheInverseTranspose) {
  Builder builder = OneTriangle();
  const float s = std::sqrt(0.5F);
  builder.root["meshes"][0]["primitives"][0]["attributes"]["POSITION"] =
      builder.Vec3s({0, 0, 0, 0, 0, 1, -1, 1, 0});  // a slope whose normal is (−1, −1, 0)/√2
  builder.root["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] =
      builder.Vec3s({-s, -s, 0, -s, -s, 0, -s, -s, 0});
  builder.root["nodes"][0]["scale"] = {1, -3, 1};
  const Document document = Open(builder);
  const Surface& surface = document.scene().surfaces.at(0);
  EXPECT_NEAR(surface.normals.at(0).dot(Front(surface, 0).normalized()), 1, 1e-7);
}

TEST(Import, GivesAFlattenedSheetTheNormalOfItsPlane) {
  Builder builder = OneTriangle();
  const float s = std::sqrt(0.5F);
  builder.root["meshes"][0]["primitives"][0]["attributes"]["POSITION"] =
      builder.Vec3s({0, 0, 0, 1, 0, -1, 0, 1, 0});
  builder.root["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] =
      builder.Vec3s({s, 0, s, s, 0, s, s, 0, s});
  builder.root["nodes"][0]["scale"] = {1, 1, 0};
  const Document document = Open(builder);
  EXPECT_TRUE(document.scene().surfaces.at(0).normals.at(0).isApprox(Vec3(0, 0, 1)));
}

TEST(Import, MultipliesTransformsDownTheTree) {
  Builder builder = OneTriangle();
  builder.root["nodes"][0] = {{"children", {1}}, {"translation", {10, 0, 0}}};
  // A matrix in column-major order: scale by 2, then move by (0, 0, 5).
  builder.Add("nodes", {{"children", {2}}, {"matrix", {2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 0, 0, 5, 1}}});
  // A quarter turn about z.
  builder.Add("nodes",
              {{"mesh", 0}, {"rotation", {0, 0, std::sqrt(0.5), std::sqrt(0.5)}}, {"scale", {1, 3, 1}}});
  const Document document = Open(builder);
  const Surface& surface = document.scene().surfaces.at(0);
  EXPECT_TRUE(surface.positions.at(1).isApprox(Vec3(10, 2, 5), 1e-12));
  EXPECT_TRUE(surface.positions.at(2).isApprox(Vec3(4, 0, 5), 1e-12));
}

TEST(Import, TakesTheDefaultSceneAlone) {
  Builder builder = OneTriangle();
  builder.Add("nodes", {{"mesh", 0}});
  builder.root["scenes"] = {{{"nodes", {0}}}, {{"nodes", {0, 1}}}};
  EXPECT_EQ(Open(builder).scene().surfaces.size(), 1U);
  builder.root["scene"] = 1;
  EXPECT_EQ(Open(builder).scene().surfaces.size(), 2U);
}

TEST(Import, TakesAllRootsOfAFileWithoutScenes) {
  Builder builder = OneTriangle();
  builder.root.erase("scene");
  builder.root.erase("scenes");
  builder.Add("nodes", {{"mesh", 0}, {"children", {2}}});
  builder.Add("nodes", {{"mesh", 0}});
  EXPECT_EQ(Open(builder).scene().surfaces.size(), 3U);
}

/// A strip of five vertices in the plane z = 0.
Builder FiveVertices(int mode) {
  Builder builder = OneTriangle();
  Json& primitive = builder.root["meshes"][0]["primitives"][0];
  primitive["attributes"]["POSITION"] = builder.Vec3s({0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 2, 0});
  primitive["mode"] = mode;
  return builder;
}

TEST(Import, UndoesStrips) {
  const Document document = Open(FiveVertices(5));
  const Surface& surface = document.scene().surfaces.at(0);
  EXPECT_THAT(surface.triangles, ElementsAre(Triangle{0, 1, 2}, Triangle{1, 3, 2}, Triangle{2, 3, 4}));
  for (std::size_t t = 0; t < 3; ++t) {
    EXPECT_GT(Front(surface, t).z(), 0);
  }
}

TEST(Import, UndoesFans) {
  EXPECT_THAT(Open(FiveVertices(6)).scene().surfaces.at(0).triangles,
              ElementsAre(Triangle{1, 2, 0}, Triangle{2, 3, 0}, Triangle{3, 4, 0}));
}

TEST(Import, ReadsIndicesOfEveryWidth) {
  for (const int component : {5121, 5123, 5125}) {
    Builder builder = FiveVertices(4);
    const std::size_t view = component == 5121   ? builder.View<std::uint8_t>({0, 1, 4})
                             : component == 5123 ? builder.View<std::uint16_t>({0, 1, 4})
                                                 : builder.View<std::uint32_t>({0, 1, 4});
    builder.root["meshes"][0]["primitives"][0]["indices"] = builder.Accessor(view, component, 3, "SCALAR");
    const Document document = Open(builder);
    const Surface& surface = document.scene().surfaces.at(0);
    ASSERT_EQ(surface.positions.size(), 3U) << "unused vertices are left out";
    EXPECT_EQ(surface.positions[surface.triangles.at(0)[2]], Vec3(0, 2, 0));
  }
}

TEST(Import, ReplacesSparseElements) {
  Builder builder = OneTriangle();
  const std::size_t indices = builder.View<std::uint16_t>({1, 2});
  const std::size_t values = builder.View<float>({4, 0, 0, 0, 5, 0});
  builder.root["accessors"][0]["sparse"] = {{"count", 2},
                                            {"indices", {{"bufferView", indices}, {"componentType", 5123}}},
                                            {"values", {{"bufferView", values}}}};
  EXPECT_EQ(Front(Open(builder).scene().surfaces.at(0), 0), Vec3(0, 0, 20));
  // Without a buffer view, all others are zero.
  builder.root["accessors"][0].erase("bufferView");
  EXPECT_EQ(Front(Open(builder).scene().surfaces.at(0), 0), Vec3(0, 0, 20));
}

TEST(Import, ReadsInterleavedVertices) {
  Builder builder = OneTriangle();
  const std::size_t view = builder.View<float>({0, 0, 0, 9, 8, 1, 0, 0, 7, 6, 0, 1, 0, 5, 4}, 20);
  const std::size_t positions = builder.Accessor(view, 5126, 3, "VEC3");
  const std::size_t coordinates = builder.Accessor(view, 5126, 3, "VEC2");
  builder.root["accessors"][coordinates]["byteOffset"] = 12;
  builder.root["meshes"][0]["primitives"][0]["attributes"] = {{"POSITION", positions},
                                                              {"TEXCOORD_0", coordinates}};
  const Document document = Open(builder);
  const Surface& surface = document.scene().surfaces.at(0);
  EXPECT_EQ(Front(surface, 0), Vec3(0, 0, 1));
  EXPECT_THAT(surface.attributes, ElementsAre(9, 8, 7, 6, 5, 4));
  EXPECT_EQ(surface.attribute_width, 2U);
}

TEST(Import, ReadsNormalizedAndQuantizedIntegers) {
  Builder builder = OneTriangle();
  builder.root["extensionsRequired"] = {"KHR_mesh_quantization"};
  Json& attributes = builder.root["meshes"][0]["primitives"][0]["attributes"];
  const std::size_t positions = builder.View<std::int16_t>({0, 0, 0, 0, 300, 0, 0, 0, 0, 200, 0, 0}, 8);
  attributes["POSITION"] = builder.Accessor(positions, 5122, 3, "VEC3");
  const std::size_t normals = builder.View<std::int8_t>({0, 0, 127, 0, 0, 0, 127, 0, 0, 0, -128, 0}, 4);
  attributes["NORMAL"] = builder.Accessor(normals, 5120, 3, "VEC3");
  builder.root["accessors"].back()["normalized"] = true;
  const std::size_t coordinates = builder.View<std::uint8_t>({0, 255, 51, 0, 255, 255}, 2);
  attributes["TEXCOORD_0"] = builder.Accessor(coordinates, 5121, 3, "VEC2");
  builder.root["accessors"].back()["normalized"] = true;
  const Document document = Open(builder);
  const Surface& surface = document.scene().surfaces.at(0);
  EXPECT_EQ(surface.positions.at(1), Vec3(300, 0, 0));
  EXPECT_EQ(surface.normals.at(2), Vec3(0, 0, -1)) << "-128 is -1 as -127 is";
  EXPECT_THAT(surface.attributes, ElementsAre(0, 1, 0.2F, 0, 1, 1));
}

TEST(Import, WeldsVerticesThatAreAllTheSame) {
  Builder builder = OneTriangle();
  Json& primitive = builder.root["meshes"][0]["primitives"][0];
  // Two triangles with an edge in common, not indexed; −0 is 0.
  primitive["attributes"]["POSITION"] =
      builder.Vec3s({0, 0, 0, 1, 0, 0, 0, 1, 0, -0.0F, 1, 0, 1, -0.0F, 0, 1, 1, 0});
  EXPECT_THAT(Open(builder).scene().surfaces.at(0).triangles,
              ElementsAre(Triangle{0, 1, 2}, Triangle{2, 1, 3}));
  // A seam of texture coordinates keeps them apart.
  primitive["attributes"]["TEXCOORD_0"] = builder.Floats({0, 0, 1, 0, 0, 1, 0, 1, 2, 0, 1, 1}, "VEC2", 2);
  EXPECT_THAT(Open(builder).scene().surfaces.at(0).triangles,
              ElementsAre(Triangle{0, 1, 2}, Triangle{2, 3, 4}));
}

TEST(Import, ReadsMaterials) {
  const Document document = Open(WithMaterial(
      {{"name", "lamp"},
       {"doubleSided", true},
       {"emissiveFactor", {1, 0.5, 0}},
       {"extensions", {{"KHR_materials_emissive_strength", {{"emissiveStrength", 8}}}}},
       {"pbrMetallicRoughness", {{"baseColorFactor", {0.1, 0.2, 0.3, 0.4}}, {"metallicFactor", 0}}}}));
  const Material& material = document.scene().materials.at(document.scene().surfaces.at(0).material);
  EXPECT_EQ(material.name, "lamp");
  EXPECT_TRUE((material.reflectance == Rgb(0.1, 0.2, 0.3)).all());
  EXPECT_TRUE((material.emission == Rgb(8, 4, 0)).all());
  EXPECT_EQ(material.sides, Sides::kBoth);
  EXPECT_EQ(material.role, Role::kDiffuse);
  EXPECT_TRUE(document.scene().ignored.empty());
  EXPECT_TRUE(document.scene().warnings.empty());
}

TEST(Import, TakesUnlitMaterialsAsBlockers) {
  const Document document = Open(WithMaterial(
      {{"emissiveFactor", {1, 1, 1}}, {"extensions", {{"KHR_materials_unlit", Json::object()}}}}));
  EXPECT_EQ(document.scene().materials.at(0).role, Role::kBlocker);
  EXPECT_TRUE((document.scene().materials.at(0).emission == 0).all());
}

TEST(Import, ClampsAFullReflectanceWithAWarning) {
  const Document document = Open(
      WithMaterial({{"name", "snow"},
                    {"pbrMetallicRoughness", {{"baseColorFactor", {1, 0.5, 2, 1}}, {"metallicFactor", 0}}}}));
  EXPECT_TRUE((document.scene().materials.at(0).reflectance == Rgb(0.9999, 0.5, 0.9999)).all());
  EXPECT_THAT(document.scene().warnings, ElementsAre(HasSubstr("material 'snow'")));
}

TEST(Import, CountsTrianglesWithoutArea) {
  Builder builder = FiveVertices(4);
  builder.root["meshes"][0]["primitives"][0]["indices"] = builder.Shorts({0, 1, 2, 1, 1, 2, 0, 2, 4});
  const Document document = Open(builder);
  EXPECT_EQ(document.scene().surfaces.at(0).triangles.size(), 3U);
  EXPECT_THAT(document.scene().warnings, Contains("2 of 3 triangles have no area"));
}

TEST(Import, LeavesDuplicateTrianglesOutWithAWarning) {
  Builder builder = OneTriangle();
  builder.Add("nodes", {{"mesh", 0}});
  builder.Add("nodes", {{"mesh", 0}, {"scale", {-1, 1, 1}}});
  builder.root["scenes"][0]["nodes"] = {0, 1, 2};
  const Document document = Open(builder);
  ASSERT_EQ(document.scene().surfaces.size(), 3U);
  EXPECT_EQ(document.scene().surfaces[0].triangles.size(), 1U);
  EXPECT_TRUE(document.scene().surfaces[1].triangles.empty());
  EXPECT_EQ(document.scene().surfaces[2].triangles.size(), 1U);
  EXPECT_THAT(document.scene().warnings, Contains("1 of 3 triangles are duplicates of others: left out"));
  // What is left out of the light stays in the file.
  const std::string baked = document.Export(TrivialBake(document.scene()));
  EXPECT_EQ(Unpacked(baked).root["nodes"].size(), 3U);
}

TEST(Import, RepairsNormalsOfLengthZero) {
  Builder builder = OneTriangle();
  builder.root["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] =
      builder.Vec3s({0, 0, 0, 0, 0, 3, 0, 3, 0});
  const Document document = Open(builder);
  EXPECT_THAT(document.scene().surfaces.at(0).normals,
              ElementsAre(Vec3(0, 0, 1), Vec3(0, 0, 1), Vec3(0, 1, 0)));
}

TEST(Import, ReadsDataUrisAndPartsOfTheUpload) {
  Builder builder = OneTriangle();
  Json root = builder.Root();
  root["buffers"][0]["uri"] = "my%20parts/mesh.bin";
  EXPECT_EQ(Document(Source{root.dump(), {{"my parts/mesh.bin", builder.binary}}}).scene().surfaces.size(),
            1U);
  EXPECT_EQ(Document(Source{root.dump(), {{"my%20parts/mesh.bin", builder.binary}}}).scene().surfaces.size(),
            1U);
  // (0,0,0) (1,0,0) (0,1,0) in base64.
  root["buffers"][0]["uri"] =
      "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA";
  EXPECT_EQ(Front(Document(Source{root.dump(), {}}).scene().surfaces.at(0), 0), Vec3(0, 0, 1));
}

TEST(Import, NamesEveryFeatureThatItDoesNotUse) {
  Builder builder =
      WithMaterial({{"name", "all"},
                    {"alphaMode", "BLEND"},
                    {"emissiveTexture", {{"index", 0}}},
                    {"normalTexture", {{"index", 0}}},
                    {"extensions", {{"EXT_glow", Json::object()}}},
                    {"pbrMetallicRoughness",
                     {{"baseColorFactor", {0.5, 0.5, 0.5, 1}},
                      {"metallicFactor", 0.5},
                      {"baseColorTexture",
                       {{"index", 0}, {"extensions", {{"KHR_texture_transform", Json::object()}}}}}}}});
  builder.root["extensionsUsed"] = {"EXT_glow", "EXT_fog"};
  builder.Add("textures", Json::object());
  builder.root["nodes"][0]["children"] = {1, 2};
  builder.Add("nodes", {{"mesh", 1}, {"name", "dancer"}});
  builder.Add("nodes", {{"mesh", 0}, {"skin", 0}, {"name", "walker"}});
  builder.Add("skins", {{"joints", {0}}});
  builder.Add("animations", {{"name", "spin"}, {"channels", Json::array()}, {"samplers", Json::array()}});
  Json& primitives = builder.root["meshes"][0]["primitives"];
  primitives[0]["attributes"]["COLOR_0"] = 0;
  primitives[0]["attributes"]["TEXCOORD_1"] = builder.Floats({0, 0, 0, 0, 0, 0}, "VEC2", 2);
  Json points = {{"attributes", {{"POSITION", 0}}}, {"mode", 0}};
  primitives.push_back(points);
  builder.Mesh({{"attributes", {{"POSITION", 0}}}, {"targets", {{{"POSITION", 0}}}}});

  const Document document = Open(builder);
  EXPECT_EQ(document.scene().surfaces.size(), 1U);
  std::vector<std::string> features;
  for (const Ignored& ignored : document.scene().ignored) {
    features.push_back(ignored.feature);
    EXPECT_FALSE(ignored.reason.empty());
    EXPECT_THAT(document.scene().warnings, Contains(HasSubstr(ignored.feature)));
  }
  EXPECT_THAT(features, testing::UnorderedElementsAre(
                            "alphaMode 'BLEND' of material 'all'", "emissiveTexture of material 'all'",
                            "normalTexture of material 'all'", "'EXT_glow' of material 'all'",
                            "metallicFactor of material 'all'", "baseColorTexture of material 'all'",
                            "KHR_texture_transform of baseColorTexture of material 'all'",
                            "extension 'EXT_glow'", "extension 'EXT_fog'", "mesh 1 of node 'dancer'",
                            "mesh 0 of node 'walker'", "animation 'spin'", "'COLOR_0' of mesh 0 primitive 0",
                            "'TEXCOORD_1' of mesh 0 primitive 0", "mesh 0 primitive 1"));
}

}  // namespace
}  // namespace radbake::gltf
