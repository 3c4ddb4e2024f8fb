// Uploads that mean harm or are broken: each ends in one InputError of one line that names the place.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <functional>
#include <limits>

#include "tests/gltf/builder_test.h"

namespace radbake::gltf {
namespace {

using testing::HasSubstr;
using testing::Not;

void ExpectRefused(const Source& source, const std::string& message) {
  try {
    const Document document(source);
    ADD_FAILURE() << "taken, and not refused with: " << message;
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr(message));
    EXPECT_THAT(error.what(), Not(HasSubstr("\n")));
  }
}

/// Refused after a change to OneTriangle().
void ExpectRefused(const std::function<void(Builder& builder)>& change, const std::string& message) {
  Builder builder = OneTriangle();
  change(builder);
  ExpectRefused(Source{builder.Glb(), {}}, message);
}

Json& Primitive(Builder& builder) {
  return builder.root["meshes"][0]["primitives"][0];
}
Json& Accessor(Builder& builder) {
  return builder.root["accessors"][0];
}

TEST(Hostile, WhatIsNotGltfIsRefused) {
  ExpectRefused(Source{"", {}}, "not glTF");
  ExpectRefused(Source{"GIF89a", {}}, "not glTF");
  ExpectRefused(Source{"{", {}}, "JSON: ");
  ExpectRefused(Source{"{}", {}}, "asset: is missing");
  ExpectRefused(Source{R"({"asset":{"version":"1.0"}})", {}}, "version '1.0' is not 2.0");
  ExpectRefused(Source{R"({"asset":{"version":"2.0"},"x":")" + std::string("\xff\n") + R"("})", {}},
                "JSON: ");
  ExpectRefused(Source{R"({"asset":{"version":"2.0"},"nodes":{}})", {}}, "nodes is not a list");
  ExpectRefused(Source{R"({"asset":{"version":"2.0"},"nodes":[7]})", {}}, "nodes holds something");
  ExpectRefused(Source{R"({"asset":{"version":"2.0"},"a":1e999})", {}}, "JSON: ");
}

TEST(Hostile, AMemberThatIsTwiceInAnObjectIsRefused) {
  ExpectRefused(Source{R"({"asset":{"version":"2.0"},"asset":{"version":"2.0"}})", {}}, "'asset' is twice");
}

TEST(Hostile, AGlbThatIsCutShortAnywhereIsRefused) {
  const std::string glb = OneTriangle().Glb();
  for (std::size_t size = 4; size < glb.size(); ++size) {
    ExpectRefused(Source{glb.substr(0, size), {}}, "the .glb is cut short");
  }
}

TEST(Hostile, AGlbWithABadHeaderIsRefused) {
  std::string glb = OneTriangle().Glb();
  glb[4] = 1;
  ExpectRefused(Source{glb, {}}, "version 1, not 2");
  glb = OneTriangle().Glb();
  glb[15] = '\x7f';  // the JSON chunk's size
  ExpectRefused(Source{glb, {}}, "chunk 0 says");
  glb = OneTriangle().Glb();
  glb[16] = 'B';
  ExpectRefused(Source{glb, {}}, "JSON in the first chunk");
}

TEST(Hostile, DeepNestingIsRefused) {
  for (const std::size_t depth : {65U, 1'000'000U}) {
    const std::string nest = std::string(depth, '[') + std::string(depth, ']');
    ExpectRefused(Source{R"({"asset":{"version":"2.0"},"extras":)" + nest + "}", {}},
                  "nested deeper than 64");
  }
  const std::string objects = [] {
    std::string text;
    for (int i = 0; i < 100'000; ++i) {
      text += R"({"a":)";
    }
    return text;
  }();
  ExpectRefused(Source{objects, {}}, "nested deeper than 64");
}

TEST(Hostile, AnIndexBeyondTheVerticesIsRefused) {
  ExpectRefused([](Builder& b) { Primitive(b)["indices"] = b.Shorts({0, 1, 3}); },
                "mesh 0 primitive 0: index 3 is beyond its 3 vertices");
}

TEST(Hostile, WhatIsShownOfAFileIsShort) {
  Builder builder = OneTriangle();
  Primitive(builder)["attributes"]["POSITION"] = Json(std::vector<int>(100'000, 7));
  try {
    const Document document(Source{builder.Glb(), {}});
    ADD_FAILURE() << "taken";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("mesh 0 primitive 0: accessor '[7,7,"));
    EXPECT_LT(std::string(error.what()).size(), 300U);
  }
}

TEST(Hostile, NumbersThatAreNotFiniteAreRefused) {
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    ExpectRefused(
        [=](Builder& b) { Primitive(b)["attributes"]["POSITION"] = b.Vec3s({0, 0, 0, 1, bad, 0, 0, 1, 0}); },
        "'POSITION' of vertex 1 is not a finite number");
    ExpectRefused(
        [=](Builder& b) {
          Primitive(b)["attributes"]["TEXCOORD_0"] = b.Floats({0, 0, bad, 0, 0, 1}, "VEC2", 2);
        },
        "'TEXCOORD_0' of vertex 1 is not a finite number");
  }
}

TEST(Hostile, TransformsThatOverflowAreRefused) {
  ExpectRefused([](Builder& b) { b.root["nodes"][0]["scale"] = {1e300, 1, 1}; },
                "node 0: a vertex is farther");
  ExpectRefused(
      [](Builder& b) {
        b.root["nodes"] = {{{"scale", {1e300, 1, 1}}, {"children", {1}}},
                           {{"mesh", 0}, {"scale", {1e300, 1, 1}}}};
      },
      "node 1: transform to world space is not finite");
  ExpectRefused([](Builder& b) { b.root["nodes"][0]["rotation"] = {0, 0, 0, 0}; },
                "node 0: rotation is zero");
  ExpectRefused([](Builder& b) { b.root["nodes"][0]["scale"] = {1, "1", 1}; },
                "node 0: scale is not a list of 3");
  ExpectRefused([](Builder& b) { b.root["nodes"][0]["matrix"] = {1, 2}; },
                "node 0: matrix is not a list of 16");
}

TEST(Hostile, AFileWithNoTrianglesIsRefused) {
  ExpectRefused(Source{R"({"asset":{"version":"2.0"}})", {}}, "no triangles");
  ExpectRefused([](Builder& b) { Primitive(b)["mode"] = 1; }, "no triangles");
  ExpectRefused([](Builder& b) { b.root["scenes"][0]["nodes"] = Json::array(); }, "no triangles");
  ExpectRefused([](Builder& b) { Primitive(b)["attributes"] = Json::object(); }, "no triangles");
  ExpectRefused([](Builder& b) { Primitive(b)["indices"] = b.Shorts({0, 1}); }, "no triangles");
}

TEST(Hostile, NodesThatAreNoTreeAreRefused) {
  ExpectRefused([](Builder& b) { b.root["nodes"][0]["children"] = {0}; }, "node 0: is in a cycle");
  ExpectRefused(
      [](Builder& b) {
        b.root["nodes"] = {{{"mesh", 0}}, {{"children", {2}}}, {{"children", {3}}}, {{"children", {1}}}};
      },
      "node 1: is in a cycle");
  ExpectRefused(
      [](Builder& b) { b.root["nodes"] = {{{"children", {2}}}, {{"children", {2}}}, {{"mesh", 0}}}; },
      "node 2: has two parents, nodes 0 and 1");
  ExpectRefused([](Builder& b) { b.root["nodes"] = {{{"children", {1, 1}}}, {{"mesh", 0}}}; },
                "names 1 twice");
  ExpectRefused([](Builder& b) { b.root["nodes"] = {{{"mesh", 0}}, {{"children", {0}}}}; },
                "scene 0: node 0 is not a root");
  ExpectRefused([](Builder& b) { b.root["scenes"][0]["nodes"] = {0, 0}; }, "names 0 twice");
}

TEST(Hostile, ALongChainOfNodesIsTaken) {
  Builder builder = OneTriangle();
  for (int i = 1; i <= 100'000; ++i) {
    builder.root["nodes"][static_cast<std::size_t>(i) - 1] = {{"children", {i}}};
    builder.Add("nodes", {{"mesh", 0}});
  }
  EXPECT_EQ(Open(builder).scene().surfaces.size(), 1U);
}

TEST(Hostile, IndicesBeyondTheirListsAreRefused) {
  ExpectRefused([](Builder& b) { b.root["scene"] = 1; }, "scene 1 is beyond");
  ExpectRefused([](Builder& b) { b.root["scenes"][0]["nodes"] = {1}; }, "scene 0: nodes 1 is beyond");
  ExpectRefused([](Builder& b) { b.root["nodes"][0]["mesh"] = 1; }, "node 0: mesh 1 is beyond");
  ExpectRefused([](Builder& b) { b.root["nodes"][0]["mesh"] = -1; }, "node 0: mesh is not a whole number");
  ExpectRefused([](Builder& b) { b.root["nodes"][0]["children"] = {9}; }, "node 0: children 9 is beyond");
  ExpectRefused([](Builder& b) { b.root["nodes"][0]["skin"] = 0; }, "node 0: skin 0 is beyond");
  ExpectRefused([](Builder& b) { b.root["nodes"][0]["camera"] = 0; }, "node 0: camera 0 is beyond");
  ExpectRefused([](Builder& b) { Primitive(b)["material"] = 0; }, "mesh 0 primitive 0: material 0 is beyond");
  ExpectRefused([](Builder& b) { Primitive(b)["attributes"]["POSITION"] = 5; },
                "mesh 0 primitive 0: accessor 5");
  ExpectRefused([](Builder& b) { Primitive(b)["indices"] = "0"; }, "mesh 0 primitive 0: accessor");
  ExpectRefused([](Builder& b) { Primitive(b)["targets"] = {{{"POSITION", 99}}}; },
                "mesh 0 primitive 0: accessor 99");
  ExpectRefused([](Builder& b) { Accessor(b)["bufferView"] = 1; }, "accessor 0: bufferView 1 is beyond");
  ExpectRefused([](Builder& b) { b.root["bufferViews"][0]["buffer"] = 1; },
                "bufferView 0: buffer 1 is beyond");
  ExpectRefused([](Builder& b) { b.Add("images", {{"bufferView", 77}, {"mimeType", "image/png"}}); },
                "image 0: buffer view 77");
  ExpectRefused([](Builder& b) { b.Add("skins", {{"joints", {0}}, {"inverseBindMatrices", 7}}); },
                "skin 0: accessor 7");
  ExpectRefused(
      [](Builder& b) {
        b.Add("animations", {{"samplers", {{{"input", 0}, {"output", 8}}}}, {"channels", {}}});
      },
      "animation 0 sampler 0: accessor 8");
}

TEST(Hostile, AccessorsBeyondTheirViewsAndViewsBeyondTheirBuffersAreRefused) {
  ExpectRefused([](Builder& b) { Accessor(b)["count"] = 4; },
                "accessor 0: 4 elements reach beyond the 36 bytes");
  ExpectRefused([](Builder& b) { Accessor(b)["byteOffset"] = 4; }, "accessor 0: 3 elements reach beyond");
  ExpectRefused([](Builder& b) { Accessor(b)["count"] = 0; }, "accessor 0: has no elements");
  ExpectRefused([](Builder& b) { b.root["bufferViews"][0]["byteLength"] = 37; },
                "bufferView 0: reaches beyond");
  ExpectRefused([](Builder& b) { b.root["bufferViews"][0]["byteOffset"] = SIZE_MAX; },
                "bufferView 0: reaches beyond");
  ExpectRefused([](Builder& b) { b.root["bufferViews"][0]["byteStride"] = 8; },
                "accessor 0: its elements are longer");
  ExpectRefused([](Builder& b) { Accessor(b)["type"] = "VEC9"; }, "accessor 0: type 'VEC9' is not known");
  ExpectRefused([](Builder& b) { Accessor(b)["componentType"] = 5124; }, "accessor 0: componentType 5124");
  ExpectRefused([](Builder& b) { Accessor(b)["type"] = "VEC2"; }, "'POSITION' has a type");
  ExpectRefused([](Builder& b) { Primitive(b)["attributes"]["NORMAL"] = b.Vec3s({0, 0, 1}); },
                "attribute 'POSITION' has 3 elements, and others 1");
  ExpectRefused([](Builder& b) { Primitive(b)["mode"] = 7; }, "mode 7 is not known");
  ExpectRefused([](Builder& b) { Primitive(b)["indices"] = 0; }, "indices are not unsigned scalars");
}

TEST(Hostile, HugeCountsAreRefusedBeforeAnythingIsAllocated) {
  for (const std::size_t count :
       {std::size_t{1} << 31U, std::size_t{1} << 60U, SIZE_MAX, SIZE_MAX / 12 + 2}) {
    ExpectRefused([=](Builder& b) { Accessor(b)["count"] = count; }, "accessor 0: ");
    ExpectRefused(
        [=](Builder& b) {
          Accessor(b)["count"] = count;
          Accessor(b).erase("bufferView");  // all zeros, and so without bytes to check against
        },
        "accessor 0: " + std::to_string(count) + " elements are more than the limit");
    ExpectRefused([=](Builder& b) { b.root["bufferViews"][0]["byteStride"] = count; }, "accessor 0: ");
    Json root = OneTriangle().Root();
    root["buffers"][0]["byteLength"] = count;
    ExpectRefused(Source{Builder::Pack(root.dump(), OneTriangle().binary), {}}, "buffer 0: says");
  }
}

TEST(Hostile, SparsePartsOutOfRangeAreRefused) {
  const auto sparse = [](std::vector<std::uint16_t> indices, std::size_t count, const std::string& message) {
    ExpectRefused(
        [&](Builder& b) {
          const std::size_t index_view = b.View(indices);
          const std::size_t value_view = b.View<float>({0, 0, 0, 1, 1, 1});
          Accessor(b)["sparse"] = {{"count", count},
                                   {"indices", {{"bufferView", index_view}, {"componentType", 5123}}},
                                   {"values", {{"bufferView", value_view}}}};
        },
        message);
  };
  sparse({0, 3}, 2, "accessor 0: sparse index 3 is out of range");
  sparse({1, 1}, 2, "accessor 0: sparse index 1 is out of range or out of order");
  sparse({0, 1}, 3, "accessor 0: 3 elements reach beyond");
  sparse({0, 1}, 0, "accessor 0: sparse count 0");
  sparse({0, 1}, SIZE_MAX, "accessor 0: sparse count");
}

TEST(Hostile, MoreTrianglesThanTheLimitAreRefused) {
  Builder builder = OneTriangle();
  builder.root["nodes"] = Json::array();
  builder.root["scenes"][0]["nodes"] = Json::array();
  for (std::size_t i = 0; i < 10; ++i) {
    builder.root["scenes"][0]["nodes"].push_back(builder.Add("nodes", {{"mesh", 0}}));
  }
  EXPECT_EQ(Document(Source{builder.Glb(), {}}, Limits{64, 10, 10}).scene().surfaces.size(), 10U);
  EXPECT_THROW(Document(Source{builder.Glb(), {}}, Limits{64, 9, 10}), InputError);
  EXPECT_THROW(Document(Source{builder.Glb(), {}}, Limits{64, 10, 9}), InputError);
}

TEST(Hostile, UrisThatLeaveTheUploadAreRefused) {
  Builder builder = OneTriangle();
  Json root = builder.Root();
  for (const std::string uri :
       {"../../etc/passwd", "/etc/passwd", "http://example.com/a.bin", "file:///etc/passwd", "a/../../b.bin",
        "%2e%2e/b.bin", "..%2fb.bin", "a\\..\\b.bin", "%2Fetc/passwd", "//host/a.bin", "C:/a.bin", "", "..",
        "a%00.bin"}) {
    root["buffers"][0]["uri"] = uri;
    // Even where a part of the upload has that name.
    ExpectRefused(Source{root.dump(), {{uri, builder.binary}}},
                  "buffer 0: URI '" + uri + "' leaves the upload");
    Json with_image = builder.Root();
    with_image["images"] = {{{"uri", uri}}};
    ExpectRefused(Source{Builder::Pack(with_image.dump(), builder.binary), {{uri, builder.binary}}},
                  "image 0: URI '" + uri + "' leaves the upload");
  }
  root["buffers"][0]["uri"] = "other.bin";
  ExpectRefused(Source{root.dump(), {{"mesh.bin", builder.binary}}},
                "buffer 0: URI 'other.bin' is not part of the upload");
  root["buffers"][0]["uri"] = "a%2";
  ExpectRefused(Source{root.dump(), {}}, "bad percent code");
}

TEST(Hostile, BadDataUrisAreRefused) {
  Json root = OneTriangle().Root();
  for (const char* uri : {"data:;base64,A*==", "data:;base64,A", "data:,abc", "data:"}) {
    root["buffers"][0]["uri"] = uri;
    ExpectRefused(Source{root.dump(), {}}, "buffer 0: the data: URI");
  }
  root["buffers"][0]["uri"] = "data:;base64,AAAA";
  ExpectRefused(Source{root.dump(), {}}, "buffer 0: says 36 bytes and has 3");
  root["buffers"][0].erase("uri");
  ExpectRefused(Source{root.dump(), {}}, "buffer 0: has no data");
}

TEST(Hostile, FactorsOutOfRangeAreRefusedWithTheMaterial) {
  const auto material = [](const Json& json, const std::string& message) {
    ExpectRefused(
        [&](Builder& b) {
          b.Add("materials", json);
          Primitive(b)["material"] = 0;
        },
        message);
  };
  material({{"emissiveFactor", {-1, 0, 0}}}, "material 0: emissiveFactor is negative or too large");
  material({{"emissiveFactor", {1, 1}}}, "material 0: emissiveFactor is not a list of 3 numbers");
  material({{"emissiveFactor", {1e300, 0, 0}}}, "material 0: emissiveFactor");
  material({{"pbrMetallicRoughness", {{"baseColorFactor", {0, -0.1, 0, 1}}}}}, "material 0: baseColorFactor");
  material({{"pbrMetallicRoughness", 1}}, "material 0: pbrMetallicRoughness is not an object");
  material({{"emissiveFactor", {1, 1, 1}},
            {"extensions", {{"KHR_materials_emissive_strength", {{"emissiveStrength", 1e38}}}}}},
           "material 0: emissiveStrength");
  material({{"emissiveFactor", {1e10, 1, 1}},
            {"extensions", {{"KHR_materials_emissive_strength", {{"emissiveStrength", 1e10}}}}}},
           "material 0: emissiveFactor × emissiveStrength");
  material({{"normalTexture", {{"index", 3}}}}, "material 0: index 3 is beyond");
  material({{"name", 3}}, "material 0: name is not a text");
}

TEST(Hostile, RequiredExtensionsThatChangeTheSceneAreRefusedByName) {
  for (const char* name : {"KHR_draco_mesh_compression", "EXT_meshopt_compression", "EXT_mesh_gpu_instancing",
                           "KHR_materials_pbrSpecularGlossiness", "ACME_new"}) {
    ExpectRefused([=](Builder& b) { b.root["extensionsRequired"] = {name}; },
                  "extensionsRequired: '" + std::string(name) + "' is not supported");
  }
  Builder builder = OneTriangle();
  builder.root["extensionsRequired"] = {"KHR_texture_transform", "KHR_materials_emissive_strength"};
  EXPECT_EQ(Open(builder).scene().surfaces.size(), 1U);
}

TEST(Hostile, ExtensionsThatAreNoObjectAreRefusedWhereverTheyStand) {
  ExpectRefused([](Builder& b) { b.root["extensions"] = 1; }, "glTF: extensions is not an object");
  ExpectRefused([](Builder& b) { b.root["asset"]["extensions"] = "a"; }, "asset: extensions is not");
  for (const char* list : {"bufferViews", "accessors", "nodes", "scenes"}) {
    const std::string kind(list, std::strlen(list) - 1);
    ExpectRefused([=](Builder& b) { b.root[list][0]["extensions"] = {1, 2}; },
                  kind + " 0: extensions is not");
  }
  ExpectRefused([](Builder& b) { Primitive(b)["extensions"] = nullptr; }, "mesh 0: extensions is not");
  ExpectRefused([](Builder& b) { b.Add("materials", {{"normalTexture", {{"extensions", 2}}}}); },
                "material 0: extensions is not");
  Builder builder = OneTriangle();
  builder.root["nodes"][0]["extensions"]["ACME_new"]["extensions"] = 1;
  builder.root["nodes"][0]["extras"]["extensions"] = 1;
  EXPECT_EQ(Open(builder).scene().surfaces.size(), 1U);
}

TEST(Hostile, NamesInMessagesStayOnOneShortLine) {
  Builder builder = OneTriangle();
  builder.Add("animations", {{"name", "two\nlines" + std::string(1000, 'x')}});
  const Document document = Open(builder);
  ASSERT_EQ(document.scene().ignored.size(), 1U);
  EXPECT_THAT(document.scene().ignored[0].feature, testing::StartsWith("animation 'two linesxxx"));
  EXPECT_LT(document.scene().ignored[0].feature.size(), 100U);
}

}  // namespace
}  // namespace radbake::gltf
