// The limits that are flags of radbaked: each refusal names its limit.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <functional>
#include <string>
#include <vector>

#include "tests/server/service_test.h"

namespace radbake::server {
namespace {

using ::testing::HasSubstr;

class LimitsTest : public testing::Test {
 protected:
  // What the job of this scene fails with where radbaked has been given this limit.
  nlohmann::json Failure(const std::string& flag, const std::string& value, const std::string& scene) const {
    Daemon daemon(folder_.path() / "data", RADBAKE_BINARY_DIR "/radbake", {flag, value});
    const Answer posted =
        daemon.client().PostForm({{"scene", scene, ""}, {"parameters", R"({"check":0})", ""}});
    EXPECT_EQ(posted.status, 202) << posted.body;
    return daemon.client().WaitFor(posted.headers.at("location"), "failed").at("error");
  }

 private:
  TemporaryFolder folder_;
};

TEST_F(LimitsTest, OfAScene) {
  const std::string box = ReadFile(RADBAKE_SOURCE_DIR "/scenes/furnace-box.glb");
  const nlohmann::json triangles = Failure("--max-triangles", "5", box);
  EXPECT_EQ(triangles.at("status"), 422);
  EXPECT_EQ(triangles.at("type"), "urn:radbake:problem:scene");
  EXPECT_THAT(triangles.at("detail").get<std::string>(), HasSubstr("the limit of 5 "));
  EXPECT_THAT(Failure("--max-nodes", "0", box).at("detail").get<std::string>(), HasSubstr("the limit of 0"));
  EXPECT_THAT(Failure("--max-json-depth", "3", box).at("detail").get<std::string>(),
              HasSubstr("nested deeper than 3"));
  // 512 × 256 by its header, which is all that there is of it.
  const std::string image = R"({"asset":{"version":"2.0"},"images":[{"uri":"data:image/png;base64,)"
                            R"(iVBORw0KGgoAAAANSUhEUgAAAgAAAAEACAIAAAA="}]})";
  EXPECT_THAT(Failure("--max-texture-pixels", "131071", image).at("detail").get<std::string>(),
              HasSubstr("the limit of 131071 pixels"));
  EXPECT_THAT(Failure("--max-texture-pixels", "131072", image).at("detail").get<std::string>(),
              HasSubstr("no triangles"));
}

// A flag, with a value that is no other's, and what a client hears that goes beyond it.
struct ClientLimit {
  std::vector<std::string> flags;
  std::function<Answer(const Daemon&)> exceed;
  int status;
  const char* named;
};

Answer Say(const Daemon& daemon, const std::string& begin) {
  std::string text;
  ReceiveUntil(Connect(daemon.port(), begin), "}", text);
  return {text.size() > 12 ? std::atoi(text.c_str() + 9) : 0, {}, text};
}

Answer PostAgain(const Daemon& daemon, int times) {
  for (int i = 0; i < times; ++i) {
    daemon.client().PostScene();
  }
  return daemon.client().Post(Glb(), "model/gltf-binary");
}

TEST_F(LimitsTest, OfAClientAreFlagsAndEachRefusalNamesItsLimit) {
  const std::string kBegun =
      "POST /v1/bakes HTTP/1.1\r\nContent-Type: model/gltf-binary\r\nContent-Length: 1000\r\n\r\nglTF";
  const std::vector<ClientLimit> limits = {
      {{"--max-upload", "1234"},
       [](const Daemon& daemon) {
         return daemon.client().Post(Glb(std::string(2000, 'x')), "model/gltf-binary");
       },
       413,
       "at most 1234 are taken"},
      {{"--max-parts", "2"},
       [](const Daemon& daemon) {
         return daemon.client().PostForm({{"a", "", ""}, {"b", "", ""}, {"scene", R"({"asset":{}})", ""}});
       },
       413,
       "the 2 parts that are taken"},
      {{"--max-head", "321"},
       [](const Daemon& daemon) {
         return daemon.client().Request("GET", "/", "H: " + std::string(400, 'x') + "\r\n");
       },
       431,
       "the 321 bytes"},
      {{"--max-headers", "3"},
       [](const Daemon& daemon) { return daemon.client().Request("GET", "/", "A: a\r\nB: b\r\nC: c\r\n"); },
       431,
       "the 3 headers"},
      {{"--head-time", "1"},
       [](const Daemon& daemon) { return Say(daemon, "GET /"); },
       408,
       "within 1 seconds"},
      {{"--idle-time", "1"},
       [&](const Daemon& daemon) { return Say(daemon, kBegun); },
       408,
       "stood still for 1 seconds"},
      {{"--least-rate", "987654321", "--idle-time", "1"},
       [&](const Daemon& daemon) { return Say(daemon, kBegun); },
       408,
       "behind 987654321 bytes a second"},
      {{"--uploads-per-minute", "3"},
       [](const Daemon& daemon) { return PostAgain(daemon, 3); },
       429,
       "the 3 uploads a minute"},
      {{"--max-queue-per-client", "2"},
       [](const Daemon& daemon) {
         Answer answer;
         EXPECT_TRUE(Eventually([&] { return (answer = PostAgain(daemon, 0)).status != 202; }));
         return answer;
       },
       429,
       "the 2 jobs already"},
      {{"--max-queue", "3"},
       [](const Daemon& daemon) {
         Answer answer;
         EXPECT_TRUE(Eventually([&] { return (answer = PostAgain(daemon, 0)).status != 202; }));
         return answer;
       },
       503,
       "the 3 jobs already"},
      {{"--max-connections", "2"},
       [](const Daemon& daemon) {
         const Descriptor one = Connect(daemon.port(), "GET");
         const Descriptor two = Connect(daemon.port(), "GET");
         return daemon.client().Get("/");
       },
       503,
       "the 2 connections"},
      {{"--max-uploads", "1"},
       [&](const Daemon& daemon) {
         Answer answer;
         EXPECT_TRUE(Eventually([&] {
           // It may come second: then it is the one that is refused.
           const Descriptor one = Connect(daemon.port(), kBegun);
           return (answer = PostAgain(daemon, 0)).status == 503;
         }));
         return answer;
       },
       503,
       "the 1 uploads"},
      {{"--max-watchers", "1"},
       [](const Daemon& daemon) {
         const std::string job = daemon.client().PostScene();
         const Descriptor one = Connect(daemon.port(), "GET " + job + "/events HTTP/1.1\r\n\r\n");
         std::string begin;
         EXPECT_TRUE(ReceiveUntil(one, "event: job", begin));
         return daemon.client().Get(job + "/events");
       },
       503,
       "the 1 watchers"}};
  TemporaryFolder own;
  const std::filesystem::path program = WriteProgram(own.path() / "radbake", "exec sleep 1000");
  for (const ClientLimit& limit : limits) {
    const Daemon daemon(own.path() / limit.flags[0], program, limit.flags);
    const Answer answer = limit.exceed(daemon);
    EXPECT_EQ(answer.status, limit.status) << limit.flags[0];
    EXPECT_THAT(answer.body, HasSubstr(limit.named)) << limit.flags[0];
  }
}

TEST_F(LimitsTest, OfDownloads) {
  TemporaryFolder own;
  const Daemon daemon(
      own.path() / "data",
      WriteProgram(own.path() / "radbake",
                   "head -c 30000000 /dev/zero > attempt/baked.glb; echo > attempt/statistics.json"),
      {"--max-downloads", "1"});
  const std::string job = daemon.client().PostScene();
  daemon.client().WaitFor(job, "succeeded");
  const Descriptor reader = Connect(daemon.port(), "GET " + job + "/scene HTTP/1.1\r\n\r\n");
  std::string begin;
  ASSERT_TRUE(ReceiveUntil(reader, "\r\n\r\n", begin)) << begin;
  const Answer full = daemon.client().Get(job + "/scene");
  EXPECT_EQ(full.status, 503);
  EXPECT_THAT(full.body, HasSubstr("the 1 downloads"));
}

TEST_F(LimitsTest, OfABakesTime) {
  TemporaryFolder own;
  const Daemon daemon(own.path() / "data", WriteProgram(own.path() / "radbake", "exec sleep 1000"),
                      {"--job-timeout", "1"});
  const nlohmann::json failed = daemon.client().WaitFor(daemon.client().PostScene(), "failed");
  EXPECT_EQ(failed.at("error").at("status"), 422);
  EXPECT_THAT(failed.at("error").at("detail").get<std::string>(),
              HasSubstr("the 1 seconds that it may take"));
}

}  // namespace
}  // namespace radbake::server
