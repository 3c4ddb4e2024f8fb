// What is taken as an upload, and what is refused of it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/http_test.h"

namespace radbake::server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class PostTest : public HttpTest {};

const std::string kGltf = R"( {"asset":{"version":"2.0"}})";

TEST_F(PostTest, AcceptsAGlbAsTheWholeBody) {
  for (const char* type : {"model/gltf-binary", "application/octet-stream", "Model/GLTF-Binary; x=y"}) {
    const Answer answer = client().Post(Glb("abc"), type);
    ASSERT_EQ(answer.status, 202) << answer.body;
    const nlohmann::json job = answer.Json();
    const std::string id = job.at("id");
    EXPECT_THAT(id, testing::MatchesRegex("[0-9a-f]{32}"));
    EXPECT_EQ(answer.headers.at("location"), "/v1/bakes/" + id);
    EXPECT_EQ(answer.headers.at("content-type"), "application/json");
    EXPECT_EQ(answer.headers.at("retry-after"), "1");
    EXPECT_EQ(job.at("status"), "queued");
    EXPECT_EQ(job.at("progress"), 0);
    EXPECT_THAT(job.at("created_at").get<std::string>(),
                testing::MatchesRegex("[0-9]{4}-[0-9]{2}-[0-9]{2}T[0-9:]{8}[.][0-9]{3}Z"));
    EXPECT_TRUE(job.at("started_at").is_null());
    EXPECT_TRUE(job.at("ended_at").is_null());
    EXPECT_EQ(ReadFile(data() / "jobs" / id / "upload/scene.glb"), Glb("abc"));
    EXPECT_EQ(ReadFile(data() / "jobs" / id / "parameters.json"), "{}");
  }
}

TEST_F(PostTest, AcceptsAFormWithParameters) {
  const Answer answer =
      client().PostForm({{"parameters", R"({"error": 0.1})", ""}, {"scene", Glb("xyz"), "s.glb"}});
  ASSERT_EQ(answer.status, 202) << answer.body;
  const std::filesystem::path job = data() / "jobs" / answer.Json().at("id").get<std::string>();
  EXPECT_EQ(ReadFile(job / "upload/scene.glb"), Glb("xyz"));
  EXPECT_EQ(ReadFile(job / "parameters.json"), R"({"error": 0.1})");
}

TEST_F(PostTest, KeepsThePartsOfAGltfUnderTheirUris) {
  const Answer answer = client().PostForm({{"box.bin", "buffer", ""},
                                           {"textures/oak%20wood.png", "image", "oak wood.png"},
                                           {"scene", kGltf, "box.gltf"},
                                           {"more", "second", "a/second.bin"}});
  ASSERT_EQ(answer.status, 202) << answer.body;
  const std::filesystem::path upload = data() / "jobs" / answer.Json().at("id").get<std::string>() / "upload";
  EXPECT_THAT(ListTree(upload), ElementsAre("a", "a/second.bin", "box.bin", "more", "oak wood.png",
                                            "scene.gltf", "textures", "textures/oak wood.png"));
  EXPECT_EQ(ReadFile(upload / "textures/oak wood.png"), "image");
  EXPECT_EQ(ReadFile(upload / "oak wood.png"), "image");
  EXPECT_EQ(ReadFile(upload / "a/second.bin"), "second");
  EXPECT_EQ(ReadFile(upload / "scene.gltf"), kGltf);
}

TEST_F(PostTest, TakesABodyInChunks) {
  const std::string glb = Glb("0123456789");
  const Answer answer = client().Request(
      "POST", "/v1/bakes", "Content-Type: model/gltf-binary\r\nTransfer-Encoding: chunked\r\n",
      "c\r\n" + glb.substr(0, 12) + "\r\na\r\n" + glb.substr(12) + "\r\n0\r\n\r\n");
  ASSERT_EQ(answer.status, 202) << answer.body;
  EXPECT_EQ(ReadFile(data() / "jobs" / answer.Json().at("id").get<std::string>() / "upload/scene.glb"), glb);
}

TEST_F(PostTest, AsksForTheBodyOfWhoWaitsForThat) {
  const std::string head = "POST /v1/bakes HTTP/1.1\r\nHost: x\r\nExpect: 100-continue\r\n";
  const Answer go_on =
      Send(port(), head + "Content-Type: model/gltf-binary\r\nContent-Length: 12\r\n\r\n" + Glb());
  EXPECT_EQ(go_on.status, 100);
  EXPECT_THAT(go_on.body, HasSubstr("HTTP/1.1 202"));
  const Answer refused =
      Send(port(), head + "Content-Type: model/gltf-binary\r\nContent-Length: 999999999\r\n\r\n");
  EXPECT_EQ(refused.status, 413);
}

TEST_F(PostTest, RefusesAnUploadWhosePartsDoNotFit) {
  ExpectProblem(client().PostForm({{"parameters", "{}", ""}}), 422, "no part named \"scene\"");
  ExpectProblem(client().PostForm({}), 422, "no part named \"scene\"");
  ExpectProblem(client().PostForm({{"scene", Glb(), ""}, {"scene", Glb(), ""}}), 422,
                "two parts named \"scene\"");
  ExpectProblem(client().PostForm({{"parameters", "{}", ""}, {"parameters", "{}", ""}}), 422, "two parts");
  ExpectProblem(client().PostForm({{"box.bin", "x", ""}, {"scene", Glb(), ""}}), 422, "\"box.bin\"");
  ExpectProblem(client().PostForm({{"scene", kGltf, ""}, {"a", "x", ""}, {"b", "x", "a"}}), 422, "\"b\"");
  ExpectProblem(client().PostForm({{"scene", kGltf, ""}, {"a", "x", ""}, {"a/b", "x", ""}}), 422, "\"a/b\"");
  ExpectProblem(client().PostForm({{"scene", kGltf, ""}, {"a/b", "x", ""}, {"a", "x", ""}}), 422, "\"a\"");
  ExpectProblem(client().PostForm({{"scene", kGltf, ""}, {"scene.gltf", "x", ""}}), 422, "\"scene.gltf\"");
  ExpectProblem(client().PostForm(std::vector<FormPart>(1001, {"scene.bin", "", ""})), 422, "\"scene.bin\"");
}

TEST_F(PostTest, RefusesTooManyParts) {
  std::vector<FormPart> parts;
  for (int i = 0; i <= 1000; ++i) {
    parts.push_back({std::to_string(i), "", ""});
  }
  ExpectProblem(client().PostForm(parts), 413, "more than the 1000 parts");
}

TEST_F(PostTest, RefusesNamesThatLeaveTheUpload) {
  for (const std::string name :
       {"../../etc/passwd", "/etc/passwd", "http://host/a.bin", "a\\\\b", "%2e%2e/x", "C:x"}) {
    ExpectProblem(client().PostForm({{"scene", kGltf, ""}, {name, "x", ""}}), 422, "no URI of a file");
    ExpectProblem(client().PostForm({{"scene", kGltf, ""}, {"a.bin", "x", name}}), 422, "no URI of a file");
  }
}

TEST_F(PostTest, RefusesParametersThatCannotBeUsed) {
  const auto post = [&](const std::string& parameters) {
    return client().PostForm({{"scene", Glb(), ""}, {"parameters", parameters, ""}});
  };
  ExpectProblem(post(R"({"eror": 0.1})"), 422, "eror");
  ExpectProblem(post(R"({"error": 7})"), 422, "error");
  ExpectProblem(post(R"({"method": "magic"})"), 422, "method");
  ExpectProblem(post("{"), 422, "");
  ExpectProblem(post(""), 422, "");
  ExpectProblem(post(std::string(5000, '[')), 422, "");
  ExpectProblem(post("\"" + std::string(70'000, 'x') + "\""), 413, "parameters");
}

TEST_F(PostTest, RefusesWhatIsNoGltf) {
  const auto post = [&](const std::string& scene) { return client().Post(scene, "model/gltf-binary"); };
  ExpectProblem(post(""), 422, "empty");
  ExpectProblem(post("hello"), 422, "not glTF");
  ExpectProblem(post("[1]"), 422, "not glTF");
  ExpectProblem(post("glTF"), 422, "truncated");
  ExpectProblem(post(Glb("abc").substr(0, 14)), 422, "truncated");
  ExpectProblem(post("glTF" + std::string("\1\0\0\0\xC\0\0\0", 8)), 422, "version 1");
}

TEST_F(PostTest, RefusesAnotherMediaType) {
  ExpectProblem(client().Post(Glb(), "text/plain"), 415, "text/plain");
  ExpectProblem(client().Post(Glb(), "application/x-www-form-urlencoded"), 415, "urlencoded");
  ExpectProblem(client().Request("POST", "/v1/bakes", "Content-Length: 12\r\n", Glb()), 415, "no type");
  ExpectProblem(client().Post(Glb(), "multipart/form-data"), 400, "boundary");
  const std::string gzip =
      "Content-Type: model/gltf-binary\r\nContent-Encoding: gzip\r\nContent-Length: 12\r\n";
  ExpectProblem(client().Request("POST", "/v1/bakes", gzip, Glb()), 415, "Content-Encoding");
}

TEST_F(PostTest, RefusesABodyOfUnclearLength) {
  const std::string type = "Content-Type: model/gltf-binary\r\n";
  ExpectProblem(client().Request("POST", "/v1/bakes", type), 411, "Content-Length");
  ExpectProblem(client().Request("POST", "/v1/bakes", type + "Content-Length: twelve\r\n"), 400,
                "Content-Length");
  ExpectProblem(client().Request("POST", "/v1/bakes", type + "Content-Length: -1\r\n"), 400,
                "Content-Length");
  ExpectProblem(
      client().Request("POST", "/v1/bakes", type + "Content-Length: 12\r\nContent-Length: 3\r\n", Glb()), 400,
      "Content-Length");
  ExpectProblem(client().Request("POST", "/v1/bakes", type + "Transfer-Encoding: gzip\r\n"), 400, "chunked");
  const std::string chunked = type + "Transfer-Encoding: chunked\r\n";
  ExpectProblem(client().Request("POST", "/v1/bakes", chunked + "Transfer-Encoding: gzip\r\n"), 400,
                "chunked");
  ExpectProblem(client().Request("POST", "/v1/bakes", chunked + "Content-Length: 12\r\n"), 400, "both");
  ExpectProblem(
      client().Request("POST", "/v1/bakes", type + "Transfer-Encoding: chunked\r\n", "no chunk\r\n\r\n"), 400,
      "breaks off");
}

TEST_F(PostTest, RefusesALargeBodyWithOrWithoutItsLength) {
  const std::string large(3 << 20, 'x');
  ExpectProblem(client().Post(large, "model/gltf-binary"), 413, "at most 1048576");
  const std::string chunk = "300000\r\n" + large + "\r\n0\r\n\r\n";
  ExpectProblem(client().Request("POST", "/v1/bakes",
                                 "Content-Type: model/gltf-binary\r\nTransfer-Encoding: chunked\r\n", chunk),
                413, "1048576");
  ExpectProblem(client().PostForm({{"scene", large, ""}}), 413, "1048576");
}

TEST_F(PostTest, HoldsNothingOfWhatIsNoMultipart) {
  const std::string junk = "--border" + std::string(3 << 19, 'x');
  ExpectProblem(client().Post(junk.substr(0, 1 << 20), "multipart/form-data; boundary=border"), 400,
                "multipart");
}

}  // namespace
}  // namespace radbake::server
