#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/service_test.h"

namespace radbake::server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

// A service whose bakes wait until the file "go" is there.
class HttpTest : public testing::Test {
 protected:
  HttpTest()
      : service_(data(), WriteProgram(folder_.path() / "radbake", "while [ ! -e " + Go().string() +
                                                                      " ]; do sleep 0.02; done\n" + kBakes)) {
  }
  std::filesystem::path data() const { return folder_.path() / "data"; }
  std::filesystem::path Go() const { return folder_.path() / "go"; }
  Client client() const { return service_.client(); }
  int port() const { return service_.port(); }

  // An answer that is one problem of RFC 9457, and no job was made.
  void ExpectProblem(const Answer& answer, int status, const std::string& detail) const {
    EXPECT_EQ(answer.status, status) << answer.body;
    ASSERT_TRUE(answer.headers.contains("content-type"));
    EXPECT_EQ(answer.headers.at("content-type"), "application/problem+json");
    const nlohmann::json problem = answer.Json();
    ASSERT_TRUE(problem.is_object()) << answer.body;
    EXPECT_EQ(problem.at("status"), status);
    EXPECT_TRUE(problem.at("type").is_string());
    EXPECT_TRUE(problem.at("title").is_string());
    EXPECT_THAT(problem.at("detail").get<std::string>(), HasSubstr(detail));
    EXPECT_TRUE(std::filesystem::is_empty(data() / "jobs"));
  }

 private:
  TemporaryFolder folder_;
  Service service_;
};

const std::string kNoJob = "/v1/bakes/00112233445566778899aabbccddeeff";
const std::string kGltf = R"( {"asset":{"version":"2.0"}})";

TEST_F(HttpTest, AcceptsAGlbAsTheWholeBody) {
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

TEST_F(HttpTest, AcceptsAFormWithParameters) {
  const Answer answer =
      client().PostForm({{"parameters", R"({"error": 0.1})", ""}, {"scene", Glb("xyz"), "s.glb"}});
  ASSERT_EQ(answer.status, 202) << answer.body;
  const std::filesystem::path job = data() / "jobs" / answer.Json().at("id").get<std::string>();
  EXPECT_EQ(ReadFile(job / "upload/scene.glb"), Glb("xyz"));
  EXPECT_EQ(ReadFile(job / "parameters.json"), R"({"error": 0.1})");
}

TEST_F(HttpTest, KeepsThePartsOfAGltfUnderTheirUris) {
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

TEST_F(HttpTest, TakesABodyInChunks) {
  const std::string glb = Glb("0123456789");
  const Answer answer = client().Request(
      "POST", "/v1/bakes", "Content-Type: model/gltf-binary\r\nTransfer-Encoding: chunked\r\n",
      "c\r\n" + glb.substr(0, 12) + "\r\na\r\n" + glb.substr(12) + "\r\n0\r\n\r\n");
  ASSERT_EQ(answer.status, 202) << answer.body;
  EXPECT_EQ(ReadFile(data() / "jobs" / answer.Json().at("id").get<std::string>() / "upload/scene.glb"), glb);
}

TEST_F(HttpTest, AsksForTheBodyOfWhoWaitsForThat) {
  const std::string head = "POST /v1/bakes HTTP/1.1\r\nHost: x\r\nExpect: 100-continue\r\n";
  const Answer go_on =
      Send(port(), head + "Content-Type: model/gltf-binary\r\nContent-Length: 12\r\n\r\n" + Glb());
  EXPECT_EQ(go_on.status, 100);
  EXPECT_THAT(go_on.body, HasSubstr("HTTP/1.1 202"));
  const Answer refused =
      Send(port(), head + "Content-Type: model/gltf-binary\r\nContent-Length: 999999999\r\n\r\n");
  EXPECT_EQ(refused.status, 413);
}

TEST_F(HttpTest, RefusesAnUploadWhosePartsDoNotFit) {
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

TEST_F(HttpTest, RefusesTooManyParts) {
  std::vector<FormPart> parts;
  for (int i = 0; i <= 1000; ++i) {
    parts.push_back({std::to_string(i), "", ""});
  }
  ExpectProblem(client().PostForm(parts), 413, "1000 parts");
}

TEST_F(HttpTest, RefusesNamesThatLeaveTheUpload) {
  for (const std::string name :
       {"../../etc/passwd", "/etc/passwd", "http://host/a.bin", "a\\\\b", "%2e%2e/x", "C:x"}) {
    ExpectProblem(client().PostForm({{"scene", kGltf, ""}, {name, "x", ""}}), 422, "no URI of a file");
    ExpectProblem(client().PostForm({{"scene", kGltf, ""}, {"a.bin", "x", name}}), 422, "no URI of a file");
  }
}

TEST_F(HttpTest, RefusesParametersThatCannotBeUsed) {
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

TEST_F(HttpTest, RefusesWhatIsNoGltf) {
  const auto post = [&](const std::string& scene) { return client().Post(scene, "model/gltf-binary"); };
  ExpectProblem(post(""), 422, "empty");
  ExpectProblem(post("hello"), 422, "not glTF");
  ExpectProblem(post("[1]"), 422, "not glTF");
  ExpectProblem(post("glTF"), 422, "truncated");
  ExpectProblem(post(Glb("abc").substr(0, 14)), 422, "truncated");
  ExpectProblem(post("glTF" + std::string("\1\0\0\0\xC\0\0\0", 8)), 422, "version 1");
}

TEST_F(HttpTest, RefusesAnotherMediaType) {
  ExpectProblem(client().Post(Glb(), "text/plain"), 415, "text/plain");
  ExpectProblem(client().Post(Glb(), "application/x-www-form-urlencoded"), 415, "urlencoded");
  ExpectProblem(client().Request("POST", "/v1/bakes", "Content-Length: 12\r\n", Glb()), 415, "no type");
  ExpectProblem(client().Post(Glb(), "multipart/form-data"), 400, "boundary");
  const std::string gzip =
      "Content-Type: model/gltf-binary\r\nContent-Encoding: gzip\r\nContent-Length: 12\r\n";
  ExpectProblem(client().Request("POST", "/v1/bakes", gzip, Glb()), 415, "Content-Encoding");
}

TEST_F(HttpTest, RefusesABodyOfUnclearLength) {
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
  ExpectProblem(
      client().Request("POST", "/v1/bakes", type + "Transfer-Encoding: chunked\r\n", "no chunk\r\n\r\n"), 400,
      "breaks off");
}

TEST_F(HttpTest, RefusesALargeBodyWithOrWithoutItsLength) {
  const std::string large(3 << 20, 'x');
  ExpectProblem(client().Post(large, "model/gltf-binary"), 413, "at most 1048576");
  const std::string chunk = "300000\r\n" + large + "\r\n0\r\n\r\n";
  ExpectProblem(client().Request("POST", "/v1/bakes",
                                 "Content-Type: model/gltf-binary\r\nTransfer-Encoding: chunked\r\n", chunk),
                413, "1048576");
  ExpectProblem(client().PostForm({{"scene", large, ""}}), 413, "1048576");
}

TEST_F(HttpTest, HoldsNothingOfWhatIsNoMultipart) {
  const std::string junk = "--border" + std::string(3 << 19, 'x');
  ExpectProblem(client().Post(junk.substr(0, 1 << 20), "multipart/form-data; boundary=border"), 400,
                "multipart");
}

TEST_F(HttpTest, KnowsNoOtherPathsAndJobs) {
  for (const std::string path : {"/", "/v1", "/v1/bakes/", "/v1/bakes/x", "/v1/bakesx", "/v1/bakes/../bakes",
                                 "/healthz/", "/v1/bakes/%00"}) {
    ExpectProblem(client().Get(path), 404, "nothing at");
  }
  ExpectProblem(client().Get(kNoJob + "/lightmap2"), 404, "nothing at");
  ExpectProblem(client().Request("POST", "/v1/other", "Content-Length: 12\r\n", Glb()), 404, "nothing at");
  for (const char* part : {"", "/scene", "/statistics"}) {
    ExpectProblem(client().Get(kNoJob + part), 404, "no such job");
  }
  ExpectProblem(client().Request("DELETE", kNoJob), 404, "no such job");
  ExpectProblem(client().Request("POST", kNoJob + "/cancel"), 404, "no such job");
  ExpectProblem(client().Get("/" + std::string(2000, 'a')), 414, "1024");
}

TEST_F(HttpTest, NamesTheMethodsOfAResource) {
  const auto allowed = [&](const std::string& method, const std::string& path) {
    const Answer answer = client().Request(method, path, "Content-Length: 0\r\n");
    ExpectProblem(answer, 405, method);
    return answer.headers.contains("allow") ? answer.headers.at("allow") : "";
  };
  EXPECT_EQ(allowed("GET", "/v1/bakes"), "POST");
  EXPECT_EQ(allowed("PUT", kNoJob), "GET, HEAD, DELETE");
  EXPECT_EQ(allowed("PATCH", kNoJob + "/scene"), "GET, HEAD");
  EXPECT_EQ(allowed("GET", kNoJob + "/cancel"), "POST");
  EXPECT_EQ(allowed("OPTIONS", "/healthz"), "GET, HEAD");
  EXPECT_EQ(allowed("TRACE", "/v1/bakes"), "POST");
}

TEST_F(HttpTest, AnswersWhatIsNoHttpWithAProblem) {
  ExpectProblem(Send(port(), "hello\r\n\r\n"), 400, "could not be read");
  ExpectProblem(Send(port(), "BREW /v1/bakes HTTP/1.1\r\n\r\n"), 400, "could not be read");
  ExpectProblem(client().Request("GET", kNoJob, "Range: bytes=9-1\r\n"), 416, "could not be read");
}

TEST_F(HttpTest, TakesNothingOfABodyForTheNextRequest) {
  const std::string smuggled = "GET /healthz HTTP/1.1\r\nHost: x\r\n\r\n";
  const Answer answer = client().Request(
      "GET", kNoJob, "Content-Length: " + std::to_string(smuggled.size()) + "\r\n", smuggled + smuggled);
  EXPECT_EQ(answer.status, 404);
  EXPECT_EQ(answer.headers.at("connection"), "close");
  EXPECT_THAT(answer.body, testing::Not(HasSubstr("HTTP/1.1")));
}

TEST_F(HttpTest, IsHealthy) {
  const Answer answer = client().Get("/healthz");
  EXPECT_EQ(answer.status, 200);
  EXPECT_EQ(answer.Json().at("status"), "ok");
}

TEST_F(HttpTest, HasNoResultBeforeTheEnd) {
  const std::string job = client().PostScene();
  for (const char* part : {"/scene", "/statistics"}) {
    const Answer answer = client().Get(job + part);
    EXPECT_EQ(answer.status, 409);
    EXPECT_EQ(answer.headers.at("content-type"), "application/problem+json");
    EXPECT_EQ(answer.headers.at("retry-after"), "1");
  }
}

TEST_F(HttpTest, HandsOutTheResult) {
  WriteFile(Go(), "");
  const std::string job = client().PostScene();
  const nlohmann::json end = client().WaitFor(job, "succeeded");
  EXPECT_EQ(end.at("progress"), 1);
  EXPECT_FALSE(end.at("ended_at").is_null());
  EXPECT_FALSE(end.contains("error"));
  const Answer scene = client().Get(end.at("links").at("scene"));
  EXPECT_EQ(scene.status, 200);
  EXPECT_EQ(scene.headers.at("content-type"), "model/gltf-binary");
  EXPECT_EQ(scene.headers.at("content-length"), "10");
  EXPECT_EQ(scene.body, "glTF baked");
  const Answer statistics = client().Get(end.at("links").at("statistics"));
  EXPECT_EQ(statistics.status, 200);
  EXPECT_EQ(statistics.headers.at("content-type"), "application/json");
  EXPECT_EQ(statistics.body, R"({"version":"0"})");
  const Answer head = client().Request("HEAD", job + "/scene");
  EXPECT_EQ(head.status, 200);
  EXPECT_EQ(head.headers.at("content-length"), "10");
  EXPECT_EQ(head.body, "");
  EXPECT_FALSE(client().Get(job).headers.contains("retry-after"));
}

TEST_F(HttpTest, ServesAWholeResultToWhoAsksForRanges) {
  WriteFile(Go(), "");
  const std::string job = client().PostScene();
  client().WaitFor(job, "succeeded");
  for (const char* range : {"bytes=0-3", "bytes=0-3,2-5,1-9", "bytes=90-99"}) {
    const Answer answer = client().Request("GET", job + "/scene", std::string("Range: ") + range + "\r\n");
    EXPECT_EQ(answer.status, 200);
    EXPECT_EQ(answer.body, "glTF baked");
  }
}

TEST_F(HttpTest, AnswersWhileUploadsStandStill) {
  const std::string job = client().PostScene();
  std::vector<Descriptor> uploads;
  uploads.reserve(20);
  for (int i = 0; i < 20; ++i) {
    uploads.push_back(Connect(port(),
                              "POST /v1/bakes HTTP/1.1\r\nHost: x\r\nContent-Type: model/gltf-binary\r\n"
                              "Content-Length: 1000\r\n\r\nglTF"));
  }
  std::vector<std::thread> threads;
  threads.reserve(64);
  for (int i = 0; i < 64; ++i) {
    threads.emplace_back([&] { EXPECT_EQ(client().Get(job).status, 200); });
  }
  for (std::thread& thread : threads) {
    thread.join();
  }
}

}  // namespace
}  // namespace radbake::server
