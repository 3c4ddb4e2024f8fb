#include "server/sandbox.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>

#include "server/child.h"
#include "tests/server/service_test.h"

namespace radbake::server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class SandboxTest : public testing::Test {
 protected:
  // Runs a shell script in a folder of its own.
  ChildEnd Run(const std::string& script, const ChildLimits& limits = {}) {
    std::filesystem::create_directories(job());
    const std::filesystem::path program = WriteProgram(folder_.path() / "program", script);
    lines_.clear();
    return RunChild(
        {program, {}, job(), limits}, [&](std::string_view line) { lines_.emplace_back(line); }, stop_);
  }
  std::filesystem::path job() const { return folder_.path() / "job"; }
  const std::filesystem::path& folder() const { return folder_.path(); }
  const std::vector<std::string>& lines() const { return lines_; }
  std::string Python(const std::string& code) const { return "exec python3 -c '" + code + "'\n"; }

 private:
  TemporaryFolder folder_;
  StopSignal stop_;
  std::vector<std::string> lines_;
};

TEST_F(SandboxTest, HasNoNetwork) {
  const ChildEnd end = Run(Python("import socket\nsocket.socket(socket.AF_INET)"));
  EXPECT_EQ(end.exit_code, 1);
  EXPECT_THAT(end.error, HasSubstr("PermissionError"));
}

TEST_F(SandboxTest, SignalsNobodyElse) {
  EXPECT_EQ(Run("kill -0 " + std::to_string(::getpid())).exit_code, 1);
  EXPECT_EQ(Run("kill -0 $$").exit_code, 0);
}

TEST_F(SandboxTest, HasNoPrivilegesToGain) {
  Run("grep -E '^(NoNewPrivs|Seccomp):' /proc/self/status | tr -s '\\t' ' '; ulimit -c");
  EXPECT_THAT(lines(), ElementsAre("NoNewPrivs: 1", "Seccomp: 2", "0"));
}

TEST_F(SandboxTest, TouchesNoFilesButItsOwn) {
  if (!Sandbox::CanConfine()) {
    GTEST_SKIP() << "this kernel has no Landlock";
  }
  ChildLimits limits;
  limits.confined = true;
  WriteFile(folder() / "secret", "secret");
  const std::string outside = folder().string();
  Run("cat " + outside + "/secret; touch " + outside + "/new; rm -f " + outside + "/secret; ls " + outside +
          "; echo mine > own && cat own; mkdir sub && mv own sub/ && cat sub/own; echo end",
      limits);
  EXPECT_THAT(lines(), ElementsAre("mine", "mine", "end"));
  EXPECT_EQ(ReadFile(folder() / "secret"), "secret");
  EXPECT_FALSE(std::filesystem::exists(folder() / "new"));
}

TEST_F(SandboxTest, WritesNoLargeFile) {
  ChildLimits limits;
  limits.file_size = 4096;
  EXPECT_EQ(Run("exec head -c 5000 /dev/zero > file", limits).signal, SIGXFSZ);
  EXPECT_EQ(std::filesystem::file_size(job() / "file"), 4096U);
}

TEST_F(SandboxTest, TakesNoMoreMemoryThanAllowed) {
  ChildLimits limits;
  limits.memory = 64 << 20U;
  const ChildEnd end = Run(Python("print(len(bytearray(1 << 24)), flush=True)\nbytearray(1 << 28)"), limits);
  EXPECT_THAT(lines(), ElementsAre("16777216"));
  EXPECT_EQ(end.exit_code, 1);
  EXPECT_THAT(end.error, HasSubstr("MemoryError"));
}

TEST_F(SandboxTest, OpensNoMoreFilesThanAllowed) {
  ChildLimits limits;
  limits.open_files = 16;
  Run("ulimit -n", limits);
  EXPECT_THAT(lines(), ElementsAre("16"));
}

TEST_F(SandboxTest, TakesNoMoreProcessorTimeThanAllowed) {
  ChildLimits limits;
  limits.cpu_time = std::chrono::seconds(1);
  EXPECT_EQ(Run("while true; do :; done", limits).signal, SIGXCPU);
}

TEST_F(SandboxTest, TakesNoLongerThanAllowed) {
  ChildLimits limits;
  limits.time = std::chrono::seconds(1);
  const ChildEnd end = Run("exec sleep 1000", limits);
  EXPECT_TRUE(end.late);
  EXPECT_EQ(end.signal, SIGTERM);
  EXPECT_FALSE(Run("exit 0", limits).late);
}

TEST_F(SandboxTest, AJobBeyondALimitFailsAtOnceWithOneSentence) {
  ChildLimits limits;
  limits.time = std::chrono::seconds(1);
  const Service service(folder() / "data", WriteProgram(folder() / "radbake", "exec sleep 1000"),
                        {1, std::chrono::hours(1), Service::SmallLimits(), "", limits});
  const nlohmann::json failed = service.client().WaitFor(service.client().PostScene(), "failed");
  EXPECT_EQ(failed.at("attempt"), 1);
  EXPECT_EQ(failed.at("error").at("type"), "urn:radbake:problem:limit");
  EXPECT_THAT(failed.at("error").at("detail").get<std::string>(), HasSubstr("1 seconds"));
}

#if !defined(RADBAKE_ADDRESS_SANITIZER) && \
    !defined(RADBAKE_THREAD_SANITIZER)  // whose shadow counts as memory
TEST_F(SandboxTest, AJobThatNeedsMoreMemoryThanAllowedFailsAtOnceWithOneSentence) {
  ChildLimits limits;
  limits.memory = 16 << 20U;
  const Service service(folder() / "data", RADBAKE_BINARY_DIR "/radbake",
                        {1, std::chrono::hours(1), Service::SmallLimits(), "", limits});
  const Answer made =
      service.client().PostForm({{"scene", ReadFile(RADBAKE_SOURCE_DIR "/scenes/cornell-box.glb"), ""},
                                 {"parameters", R"({"error": 0.01, "check": 0})", ""}});
  ASSERT_EQ(made.status, 202) << made.body;
  const nlohmann::json failed = service.client().WaitFor(made.headers.at("location"), "failed");
  EXPECT_EQ(failed.at("attempt"), 1);
  EXPECT_EQ(failed.at("error").at("type"), "urn:radbake:problem:limit");
  EXPECT_THAT(failed.at("error").at("detail").get<std::string>(), HasSubstr("16777216 bytes of memory"));
}

TEST_F(SandboxTest, AJobThatNeedsMoreMemoryThanAllowedForItsErrorIsBakedCoarser) {
  ChildLimits limits;
  limits.memory = 32 << 20U;
  const Service service(folder() / "data", RADBAKE_BINARY_DIR "/radbake",
                        {1, std::chrono::hours(1), Service::SmallLimits(), "", limits});
  const Answer made =
      service.client().PostForm({{"scene", ReadFile(RADBAKE_SOURCE_DIR "/scenes/cornell-box.glb"), ""},
                                 {"parameters", R"({"error": 0.01, "basis": "constant", "check": 0})", ""}});
  ASSERT_EQ(made.status, 202) << made.body;
  service.client().WaitFor(made.headers.at("location"), "succeeded");
  const auto statistics =
      nlohmann::json::parse(service.client().Get(made.headers.at("location") + "/statistics").body);
  EXPECT_EQ(statistics.at("stopped_by"), "limit");
  EXPECT_LT(statistics.at("memory").at("limit_bytes"), limits.memory);
  EXPECT_THAT(statistics.at("warnings").dump(), HasSubstr("would have needed"));
}

TEST_F(SandboxTest, IsLimitedUnlessToldOtherwise) {
  const std::string limits = (folder() / "limits").string();
  const std::filesystem::path program = WriteProgram(
      folder() / "radbake", "for of in d t f n; do ulimit -$of; done > " + limits + "\n" + kBakes);
  const auto limits_with = [&](const std::vector<std::string>& flags) {
    const Daemon daemon(folder() / "data", program, flags);
    daemon.client().WaitFor(daemon.client().PostScene(), "succeeded");
    return ReadFile(limits);
  };
  EXPECT_THAT(limits_with({}), testing::MatchesRegex("([0-9]+\n){4}"));
  // The shell tells kilobytes of the first and half kilobytes of the third.
  EXPECT_EQ(limits_with({"--job-memory", "268435456", "--job-cpu-time", "123", "--job-file-size", "65536",
                         "--job-open-files", "77"}),
            "262144\n123\n128\n77\n");
}
#endif

#ifndef RADBAKE_THREAD_SANITIZER  // the sandbox keeps the library of such a build from radbake
TEST_F(SandboxTest, TheRealRadbakeBakesInIt) {
  ChildLimits limits;
  limits.open_files = 256;
  limits.file_size = 1ULL << 30U;
  limits.confined = true;
  const Service service(folder() / "data", RADBAKE_BINARY_DIR "/radbake",
                        {1, std::chrono::hours(1), Service::SmallLimits(), "", limits});
  const Answer made =
      service.client().PostForm({{"scene", ReadFile(RADBAKE_SOURCE_DIR "/scenes/cornell-box.glb"), ""},
                                 {"parameters", R"({"error": 0.2, "check": 0})", ""}});
  ASSERT_EQ(made.status, 202) << made.body;
  service.client().WaitFor(made.headers.at("location"), "succeeded");
}
#endif

}  // namespace
}  // namespace radbake::server
