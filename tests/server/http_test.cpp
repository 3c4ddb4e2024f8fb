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
  EXPECT_EQ(allowed("PUT", "/v1/bakes"), "GET, HEAD, POST");
  EXPECT_EQ(allowed("PUT", kNoJob), "GET, HEAD, DELETE");
  EXPECT_EQ(allowed("PATCH", kNoJob + "/scene"), "GET, HEAD");
  EXPECT_EQ(allowed("GET", kNoJob + "/cancel"), "POST");
  EXPECT_EQ(allowed("OPTIONS", "/healthz"), "GET, HEAD");
  EXPECT_EQ(allowed("TRACE", "/v1/bakes"), "GET, HEAD, POST");
}

TEST_F(HttpTest, AnswersWhatIsNoHttpWithAProblem) {
  ExpectProblem(Send(port(), "hello\r\n\r\n"), 400, "could not be read");
  ExpectProblem(Send(port(), "BREW /v1/bakes HTTP/1.1\r\n\r\n"), 400, "could not be read");
  ExpectProblem(client().Request("GET", kNoJob, "no header\r\n"), 400, "no header");
  ExpectProblem(client().Request("GET", kNoJob, "Name : x\r\n"), 400, "no header");
  ExpectProblem(client().Request("GET", kNoJob, "Range: bytes=9-1\r\n"), 404, "no such job");
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

TEST_F(HttpTest, ServesOneRangeOfAResult) {
  WriteFile(Go(), "");
  const std::string job = client().PostScene();
  client().WaitFor(job, "succeeded");
  const auto get = [&](const std::string& headers) {
    return client().Request("GET", job + "/scene", headers);
  };
  const Answer part = get("Range: bytes=2-5\r\n");
  EXPECT_EQ(part.status, 206);
  EXPECT_EQ(part.body, "TF b");
  EXPECT_EQ(part.headers.at("content-range"), "bytes 2-5/10");
  EXPECT_EQ(part.headers.at("content-length"), "4");
  EXPECT_EQ(get("Range: bytes=-3\r\n").body, "ked");
  EXPECT_EQ(get("Range: bytes=7-\r\n").body, "ked");
  EXPECT_EQ(get("Range: bytes=7-99\r\n").body, "ked");
  const Answer none = get("Range: bytes=10-\r\n");
  EXPECT_EQ(none.status, 416);
  EXPECT_EQ(none.headers.at("content-range"), "bytes */10");
  // Overlapping ranges would multiply what is sent: several are served as the whole.
  const Answer whole = get("Range: bytes=0-3,2-5,1-9\r\n");
  EXPECT_EQ(whole.status, 200);
  EXPECT_EQ(whole.body, "glTF baked");
  EXPECT_EQ(whole.headers.at("accept-ranges"), "bytes");
  EXPECT_EQ(get("Range: bytes=2-5\r\nIf-Range: " + whole.headers.at("etag") + "\r\n").status, 206);
  EXPECT_EQ(get("Range: bytes=2-5\r\nIf-Range: \"other\"\r\n").status, 200);
  EXPECT_EQ(client().Request("GET", job, "Range: bytes=0-1\r\n").status, 200) << "a job changes";
}

TEST_F(HttpTest, SendsAResultOnceToWhoKeepsItsTag) {
  WriteFile(Go(), "");
  const std::string job = client().PostScene();
  client().WaitFor(job, "succeeded");
  const std::string tag = client().Get(job + "/scene").headers.at("etag");
  EXPECT_NE(tag, client().Get(job + "/statistics").headers.at("etag"));
  const Answer same = client().Request("GET", job + "/scene", "If-None-Match: \"x\", " + tag + "\r\n");
  EXPECT_EQ(same.status, 304);
  EXPECT_EQ(same.body, "");
  EXPECT_EQ(same.headers.at("etag"), tag);
  EXPECT_FALSE(same.headers.contains("content-length"));
  EXPECT_EQ(client().Request("GET", job + "/scene", "If-None-Match: \"x\"\r\n").status, 200);
}

TEST_F(HttpTest, PacksStatisticsForWhoTakesGzip) {
  WriteFile(Go(), "");
  const std::string job = client().PostScene();
  client().WaitFor(job, "succeeded");
  const Answer packed = client().Request("GET", job + "/statistics", "Accept-Encoding: br, gzip\r\n");
  EXPECT_EQ(packed.status, 200);
  EXPECT_EQ(packed.headers.at("content-encoding"), "gzip");
  EXPECT_EQ(packed.headers.at("vary"), "Accept-Encoding");
  EXPECT_EQ(packed.body.substr(0, 2), "\x1F\x8B");
  const Answer plain = client().Get(job + "/statistics");
  EXPECT_FALSE(plain.headers.contains("content-encoding"));
  EXPECT_NE(plain.headers.at("etag"), packed.headers.at("etag"));
  EXPECT_FALSE(client()
                   .Request("GET", job + "/scene", "Accept-Encoding: gzip\r\n")
                   .headers.contains("content-encoding"));
}

TEST_F(HttpTest, SaysThatThereIsNoLightmap) {
  WriteFile(Go(), "");
  const std::string job = client().PostScene();
  client().WaitFor(job, "succeeded");
  const Answer answer = client().Get(job + "/lightmap");
  EXPECT_EQ(answer.status, 404);
  EXPECT_THAT(answer.Json().at("detail").get<std::string>(), HasSubstr("no lightmap"));
}

TEST_F(HttpTest, ListsJobsInPagesNewestFirst) {
  std::vector<std::string> jobs;
  for (int i = 0; i < 5; ++i) {
    jobs.push_back(client().PostScene());
    // Jobs of one millisecond have no order but that of their ids.
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  client().WaitFor(jobs[0], "running");
  std::vector<std::string> listed;
  std::string path = "/v1/bakes?limit=2";
  for (int page = 0; page < 3; ++page) {
    const Answer answer = client().Get(path);
    ASSERT_EQ(answer.status, 200) << answer.body;
    const nlohmann::json shown = answer.Json();
    for (const nlohmann::json& job : shown.at("bakes")) {
      listed.push_back(job.at("links").at("self"));
    }
    path = shown.at("next").is_string() ? shown.at("next").get<std::string>() : "";
    if (page == 0) {
      client().Request("DELETE", jobs[3]);  // where the page ended
    }
  }
  EXPECT_THAT(listed, ElementsAre(jobs[4], jobs[3], jobs[2], jobs[1], jobs[0]));
  EXPECT_EQ(path, "");
  const nlohmann::json running = client().Get("/v1/bakes?status=running").Json().at("bakes");
  ASSERT_EQ(running.size(), 1U);
  EXPECT_EQ(running[0].at("links").at("self"), jobs[0]);
  EXPECT_TRUE(client().Get("/v1/bakes?status=failed").Json().at("bakes").empty());
}

TEST_F(HttpTest, NamesWhatAPageCannotTake) {
  ExpectProblem(client().Get("/v1/bakes?status=done"), 400, "status is \"done\"");
  ExpectProblem(client().Get("/v1/bakes?limit=0"), 400, "limit is \"0\"");
  ExpectProblem(client().Get("/v1/bakes?limit=1001"), 400, "limit");
  ExpectProblem(client().Get("/v1/bakes?limit=2x"), 400, "limit");
  ExpectProblem(client().Get("/v1/bakes?after=x"), 400, "after");
  ExpectProblem(client().Get("/v1/bakes?page=2"), 400, "\"page\"");
}

TEST_F(HttpTest, MakesOneJobOfARepeatedPost) {
  const auto post = [&](const std::string& key, const std::string& scene) {
    return client().Request("POST", "/v1/bakes",
                            "Content-Type: model/gltf-binary\r\nIdempotency-Key: " + key +
                                "\r\nContent-Length: " + std::to_string(scene.size()) + "\r\n",
                            scene);
  };
  const Answer first = post("key-1", Glb("abc"));
  ASSERT_EQ(first.status, 202) << first.body;
  const Answer again = post("key-1", Glb("abc"));
  EXPECT_EQ(again.status, 202);
  EXPECT_EQ(again.headers.at("location"), first.headers.at("location"));
  const Answer other = post("key-1", Glb("abd"));
  EXPECT_EQ(other.status, 422);
  EXPECT_EQ(other.Json().at("type"), "urn:radbake:problem:key-reused");
  EXPECT_NE(post("key-2", Glb("abc")).headers.at("location"), first.headers.at("location"));
  EXPECT_EQ(post("with space", Glb("abc")).status, 400);
  EXPECT_EQ(post(std::string(256, 'k'), Glb("abc")).status, 400);
  using Folders = std::filesystem::directory_iterator;
  EXPECT_EQ(std::distance(Folders(data() / "jobs"), Folders()), 2)
      << "nothing is left of the repeated uploads";
  WriteFile(Go(), "");
  client().WaitFor(first.headers.at("location"), "succeeded");
  EXPECT_EQ(post("key-1", Glb("abc")).status, 200);
  client().Request("DELETE", first.headers.at("location"));
  EXPECT_NE(post("key-1", Glb("abc")).headers.at("location"), first.headers.at("location"));
}

TEST_F(HttpTest, TellsAPayloadByItsPartsAlone) {
  const auto post = [&](const std::string& border, const std::vector<FormPart>& parts) {
    std::string body;
    for (const FormPart& part : parts) {
      body += "--" + border + "\r\nContent-Disposition: form-data; name=\"" + part.name + "\"\r\n\r\n" +
              part.content + "\r\n";
    }
    body += "--" + border + "--\r\n";
    const Answer answer =
        client().Request("POST", "/v1/bakes",
                         "Idempotency-Key: form\r\nContent-Type: multipart/form-data; boundary=" + border +
                             "\r\nContent-Length: " + std::to_string(body.size()) + "\r\n",
                         body);
    return answer.status;
  };
  EXPECT_EQ(post("one", {{"scene", Glb(), ""}, {"parameters", "{}", ""}}), 202);
  EXPECT_EQ(post("two", {{"parameters", "{}", ""}, {"scene", Glb(), ""}}), 202);
  EXPECT_EQ(post("one", {{"scene", Glb(), ""}, {"parameters", "{ }", ""}}), 422);
  EXPECT_EQ(post("one", {{"scene", Glb(), ""}}), 422);
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
