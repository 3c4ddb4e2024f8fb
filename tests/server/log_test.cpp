// The log and the ids by which its lines are found; what radbaked says without serving.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <csignal>
#include <cstdio>
#include <set>
#include <sstream>

#include "server/http_connection.h"
#include "tests/server/service_test.h"

namespace radbake::server {
namespace {

using ::testing::HasSubstr;
using ::testing::MatchesRegex;

TEST(RequestId, IsTheClientsWhereItIsFit) {
  EXPECT_EQ(Harmless("GET / HTTP/1.1\r\nx-request-id:  a-1_b.C\r\n\r\n"),
            "GET / HTTP/1.1\r\nx-request-id:  a-1_b.C\r\n\r\n");
  EXPECT_EQ(Harmless("GET / HTTP/1.1\r\nX-Request-Id: a b\r\nX-Request-Id: c\r\nX-Request-Id: d\r\n\r\n"),
            "GET / HTTP/1.1\r\nX-Request-Id: c\r\n\r\n");
  EXPECT_EQ(Harmless("GET / HTTP/1.1\r\nX-Request-Id: " + std::string(129, 'a') + "\r\n\r\n"),
            "GET / HTTP/1.1\r\n\r\n");
}

TEST(RequestId, IsMadeWhereThereIsNone) {
  EXPECT_THAT(Identified("GET / HTTP/1.1\r\nHost: x\r\n\r\n"),
              MatchesRegex("GET / HTTP/1.1\r\nHost: x\r\nX-Request-Id: [0-9a-f]+\r\n\r\n"));
  const std::string has = "GET / HTTP/1.1\r\nx-request-id: 7\r\n\r\n";
  EXPECT_EQ(Identified(has), has);
}

class LogTest : public testing::Test {
 protected:
  std::filesystem::path data() const { return folder_.path() / "data"; }
  std::filesystem::path Program() const { return WriteProgram(folder_.path() / "radbake", kBakes); }
  std::string File(const std::string& name, const std::string& text) const {
    WriteFile(folder_.path() / name, text);
    return (folder_.path() / name).string();
  }
  // The lines of a log, each an object.
  static std::vector<nlohmann::json> Lines(const std::string& log) {
    std::vector<nlohmann::json> lines;
    std::istringstream stream(log);
    for (std::string line; std::getline(stream, line);) {
      lines.push_back(nlohmann::json::parse(line, nullptr, false));
      EXPECT_TRUE(lines.back().is_object()) << line;
    }
    return lines;
  }
  // What the program says, and how it ends.
  struct Said {
    int code = -1;
    std::string text;
  };
  Said Run(const std::string& flags) const {
    const std::string command = RADBAKE_BINARY_DIR "/radbaked --radbake " + Program().string() + " --data " +
                                data().string() + " " + flags + " 2>&1";
    Said said;
    std::FILE* const pipe = ::popen(command.c_str(), "r");
    for (int c = 0; pipe != nullptr && (c = std::fgetc(pipe)) != EOF;) {
      said.text += static_cast<char>(c);
    }
    const int status = ::pclose(pipe);
    said.code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    return said;
  }

 private:
  TemporaryFolder folder_;
};

TEST_F(LogTest, IsOneObjectALineWithTheIdsOfRequestAndJob) {
  Daemon daemon(data(), Program());
  ASSERT_NE(daemon.port(), 0);
  const Answer posted = daemon.client().Request(
      "POST", "/v1/bakes", "Content-Type: model/gltf-binary\r\nContent-Length: 12\r\nX-Request-Id: my-1\r\n",
      Glb());
  ASSERT_EQ(posted.status, 202);
  EXPECT_EQ(posted.headers.at("x-request-id"), "my-1");
  const std::string job = posted.Json().at("id");
  daemon.client().WaitFor(posted.headers.at("location"), "succeeded");
  daemon.client().Request("GET", "/\"quoted\"\\/\xFF", "X-Request-Id: bad id\r\n");
  EXPECT_EQ(daemon.End(SIGTERM), 0);
  bool answered = false;
  bool baked = false;
  bool quoted = false;
  for (const nlohmann::json& line : Lines(daemon.Log())) {
    EXPECT_THAT(line.at("time").get<std::string>(),
                MatchesRegex("[0-9]{4}-[0-9]{2}-[0-9]{2}T[0-9:]{8}[.][0-9]{3}Z"));
    EXPECT_TRUE(line.at("level").is_string());
    EXPECT_TRUE(line.at("message").is_string());
    if (line.value("request", "") == "my-1") {
      answered = true;
      EXPECT_EQ(line.at("job"), job);
      EXPECT_EQ(line.at("method"), "POST");
      EXPECT_EQ(line.at("target"), "/v1/bakes");
      EXPECT_EQ(line.at("status"), 202);
      EXPECT_GE(line.at("seconds"), 0);
    }
    EXPECT_NE(line.value("request", ""), "bad id");
    baked = baked || (line.value("job", "") == job && !line.contains("request"));
    quoted = quoted || line.value("target", "").starts_with("/\"quoted\"");
  }
  EXPECT_TRUE(answered);
  EXPECT_TRUE(baked);
  EXPECT_TRUE(quoted);
}

TEST_F(LogTest, EveryAnswerCarriesARequestId) {
  HttpLimits limits = Service::SmallLimits();
  const Service service(data(), Program(), {1, std::chrono::hours(1), limits, "", {}, 0, {}});
  const Client client = service.client();
  std::set<std::string> ids;
  const auto take = [&](const Answer& answer) {
    ASSERT_TRUE(answer.headers.contains("x-request-id")) << answer.status;
    EXPECT_TRUE(ids.insert(answer.headers.at("x-request-id")).second);
  };
  take(client.Get("/healthz"));
  take(client.Get("/nothing"));
  take(client.Request("DELETE", "/healthz"));
  take(Send(service.port(), "what\r\n\r\n"));
  take(client.Request("GET", "/healthz", "no header\r\n"));
  take(client.Post(Glb(), "model/gltf-binary"));
  take(client.Request("POST", "/v1/bakes",
                      "Expect: 100-continue\r\nContent-Type: text/plain\r\nContent-Length: 1\r\n"));
  const Answer held = client.Request(
      "POST", "/v1/bakes",
      "Content-Type: model/gltf-binary\r\nContent-Length: 12\r\nPrefer: wait=60\r\nX-Request-Id: held\r\n",
      Glb());
  EXPECT_EQ(held.headers.at("x-request-id"), "held");
}

TEST_F(LogTest, TheProgramSaysItsVersion) {
  const Said said = Run("--version");
  EXPECT_EQ(said.code, 0);
  EXPECT_EQ(said.text, "radbaked " RADBAKE_VERSION "\n");
}

TEST_F(LogTest, TheConfigurationIsCheckedWithoutServing) {
  const Said good = Run("--check-config --tokens " + File("tokens", "me " + std::string(64, 'a') + "\n"));
  EXPECT_EQ(good.code, 0) << good.text;
  EXPECT_FALSE(std::filesystem::exists(data())) << "nothing is made";
  const auto expect_bad = [&](const std::string& flags, const std::string& what) {
    const Said said = Run("--check-config " + flags);
    EXPECT_EQ(said.code, 2) << said.text;
    EXPECT_THAT(said.text, HasSubstr(what));
  };
  expect_bad("--tokens " + File("bad", "me 12\n"), "line 1");
  expect_bad("--tokens " + data().string() + "/none", "none");
  expect_bad("--listen 0.0.0.0:80", "--tokens");
  expect_bad("--workers none", "--workers");
  expect_bad("--allow-origin https://example.org/page", "--allow-origin");
  WriteFile(data(), "a file");
  expect_bad("", "--data");
}

}  // namespace
}  // namespace radbake::server
