// What there is to ask for, and how a request must look.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/http_test.h"

namespace radbake::server {
namespace {

using ::testing::HasSubstr;

class RoutesTest : public HttpTest {};

TEST_F(RoutesTest, KnowsNoOtherPathsAndJobs) {
  for (const std::string path : {"/v1", "/v1/bakes/", "/v1/bakes/x", "/v1/bakesx", "/v1/bakes/../bakes",
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

TEST_F(RoutesTest, NamesTheMethodsOfAResource) {
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

TEST_F(RoutesTest, AnswersWhatIsNoHttpWithAProblem) {
  ExpectProblem(Send(port(), "hello\r\n\r\n"), 400, "could not be read");
  ExpectProblem(Send(port(), "BREW /v1/bakes HTTP/1.1\r\n\r\n"), 400, "could not be read");
  ExpectProblem(client().Request("GET", kNoJob, "no header\r\n"), 400, "no header");
  ExpectProblem(client().Request("GET", kNoJob, "Name : x\r\n"), 400, "no header");
  ExpectProblem(client().Request("GET", kNoJob, "Range: bytes=9-1\r\n"), 404, "no such job");
}

TEST_F(RoutesTest, TakesNothingOfABodyForTheNextRequest) {
  const std::string smuggled = "GET /healthz HTTP/1.1\r\nHost: x\r\n\r\n";
  const Answer answer = client().Request(
      "GET", kNoJob, "Content-Length: " + std::to_string(smuggled.size()) + "\r\n", smuggled + smuggled);
  EXPECT_EQ(answer.status, 404);
  EXPECT_EQ(answer.headers.at("connection"), "close");
  EXPECT_THAT(answer.body, testing::Not(HasSubstr("HTTP/1.1")));
}

TEST_F(RoutesTest, IsHealthy) {
  const Answer answer = client().Get("/healthz");
  EXPECT_EQ(answer.status, 200);
  EXPECT_EQ(answer.Json().at("status"), "ok");
}

TEST_F(RoutesTest, AnswersWhileUploadsStandStill) {
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
