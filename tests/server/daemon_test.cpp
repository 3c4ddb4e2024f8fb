// The program radbaked: how it starts and stops, and what a kill leaves behind.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <csignal>
#include <sstream>
#include <thread>

#include "tests/server/service_test.h"

namespace radbake::server {
namespace {

using ::testing::ElementsAre;

class DaemonTest : public testing::Test {
 protected:
  // $test: the test's own folder.
  std::filesystem::path Program(const std::string& script) const {
    return WriteProgram(folder() / "radbake", "test=" + folder().string() + "\n" + script);
  }
  const std::filesystem::path& folder() const { return folder_.path(); }
  std::filesystem::path data() const { return folder() / "data"; }
  std::ptrdiff_t Lines(const std::string& name) const {
    const std::string text = ReadFile(folder() / name);
    return std::count(text.begin(), text.end(), '\n');
  }
  // No child that wrote its process id to $test/pids runs; a dead one may wait to be reaped by whoever does
  // that.
  bool ChildrenAreGone() const {
    std::istringstream pids(ReadFile(folder() / "pids"));
    for (std::string pid; std::getline(pids, pid);) {
      const std::string stat = ReadFile("/proc/" + pid + "/stat");
      if (!stat.empty() && stat.substr(stat.rfind(')'), 3) != ") Z") {
        return false;
      }
    }
    return true;
  }
  // Only what a job that has succeeded keeps.
  void ExpectNothingLeftOver(const std::string& job) const {
    const std::filesystem::path jobs = data() / "jobs";
    const std::string id = job.substr(job.rfind('/') + 1);
    EXPECT_THAT(ListTree(jobs),
                ElementsAre(id, id + "/baked.glb", id + "/parameters.json", id + "/statistics.json",
                            id + "/upload", id + "/upload/scene.glb"));
  }

 private:
  TemporaryFolder folder_;
};

TEST_F(DaemonTest, StopsCleanlyOnSigterm) {
  Daemon daemon(data(), Program("echo $$ >> $test/pids; exec sleep 1000"), {"--grace", "0s"});
  ASSERT_NE(daemon.port(), 0);
  daemon.client().WaitFor(daemon.client().PostScene(), "running");
  EXPECT_TRUE(Eventually([&] { return Lines("pids") == 1; }));
  EXPECT_EQ(daemon.End(SIGTERM), 0);
  EXPECT_TRUE(ChildrenAreGone());
}

TEST_F(DaemonTest, LetsABakeEndWithinItsGrace) {
  const std::filesystem::path program =
      Program("touch $test/started; while [ ! -e $test/go ]; do sleep 0.02; done" + kBakes);
  std::string job;
  {
    Daemon daemon(data(), program, {"--grace", "1m"});
    ASSERT_NE(daemon.port(), 0);
    job = daemon.client().PostScene();
    EXPECT_TRUE(Eventually([&] { return std::filesystem::exists(folder() / "started"); }));
    std::thread later([&] {
      EXPECT_TRUE(Eventually([&] { return daemon.client().Get(job).status == 0; }))
          << "it takes no more requests";
      WriteFile(folder() / "go", "");
    });
    EXPECT_EQ(daemon.End(SIGTERM), 0);
    later.join();
  }
  Daemon next(data(), folder() / "radbake");
  ASSERT_NE(next.port(), 0);
  EXPECT_EQ(next.client().Get(job).Json().at("attempt"), 1);
  EXPECT_EQ(next.client().Get(job).Json().at("status"), "succeeded");
}

TEST_F(DaemonTest, TakesNoJobWhileItStops) {
  const std::filesystem::path program =
      Program("echo run >> $test/runs; while [ ! -e $test/go ]; do sleep 0.02; done" + kBakes);
  Daemon daemon(data(), program, {"--grace", "1m", "--workers", "1"});
  ASSERT_NE(daemon.port(), 0);
  for (int i = 0; i < 3; ++i) {
    daemon.client().PostScene();
  }
  EXPECT_TRUE(Eventually([&] { return Lines("runs") == 1; }));
  // For this client it waits a little.
  const Descriptor slow = Connect(daemon.port(),
                                  "POST /v1/bakes HTTP/1.1\r\nContent-Type: model/gltf-binary\r\n"
                                  "Content-Length: 1000\r\n\r\nglTF");
  EXPECT_TRUE(Eventually(
      [&] { return std::distance(std::filesystem::directory_iterator(data() / "jobs"), {}) == 4; }));
  daemon.Signal(SIGTERM);
  EXPECT_TRUE(Eventually([&] { return daemon.Log().find("stopping") != std::string::npos; }));
  WriteFile(folder() / "go", "");
  EXPECT_EQ(daemon.End(SIGTERM), 0);
  EXPECT_EQ(Lines("runs"), 1);
}

TEST_F(DaemonTest, HasAsManyConnectionsAsItPromisesWhateverTheShellAllows) {
  rlimit before{};
  ::getrlimit(RLIMIT_NOFILE, &before);
  const rlimit few{64, before.rlim_max};
  ::setrlimit(RLIMIT_NOFILE, &few);
  const Daemon daemon(data(), Program(kBakes), {"--head-time", "3600"});
  ::setrlimit(RLIMIT_NOFILE, &before);
  ASSERT_NE(daemon.port(), 0);
  std::vector<Descriptor> open;
  for (int i = 0; i < 200; ++i) {
    open.push_back(Connect(daemon.port(), "GET"));
  }
  EXPECT_EQ(daemon.client().Get("/healthz").status, 200);
}

TEST_F(DaemonTest, RefusesToStartWithAnErrorWhenItCannotServe) {
  const std::filesystem::path program = Program(kBakes);
  Daemon first(data(), program);
  ASSERT_NE(first.port(), 0);
  EXPECT_EQ(Daemon(data(), program).End(0), 1) << "the folder is taken";
  EXPECT_EQ(
      Daemon(folder() / "other", program, {"--listen", "127.0.0.1:" + std::to_string(first.port())}).End(0),
      1)
      << "the port is taken";
  EXPECT_EQ(Daemon(folder() / "other", folder() / "none").End(0), 1) << "there is no radbake";
  EXPECT_EQ(Daemon(folder() / "other", program, {"--workers", "0"}).End(0), 2);
  EXPECT_EQ(Daemon(folder() / "other", program, {"--listen", "localhost"}).End(0), 2);
  EXPECT_EQ(Daemon(folder() / "other", program, {"--listen", "127.0.0.1:70000"}).End(0), 2);
  EXPECT_EQ(Daemon(folder() / "other", program, {"--keep", "tomorrow"}).End(0), 2);
  EXPECT_EQ(Daemon(folder() / "other", program, {"--database-timeout", "0s"}).End(0), 2);
  for (const char* flag : {"--max-uploads", "--max-parts", "--uploads-per-minute", "--max-connections"}) {
    EXPECT_EQ(Daemon(folder() / "other", program, {flag, "-1"}).End(0), 2) << flag;
  }
  EXPECT_EQ(Daemon(folder() / "other", program, {"--tokens", (folder() / "none").string()}).End(0), 1);
}

TEST_F(DaemonTest, ListensToOtherMachinesOnlyIfToldWhoMayOrThatEverybodyMay) {
  const std::filesystem::path program = Program(kBakes);
  const std::string tokens = (folder() / "tokens").string();
  WriteFile(tokens, "me " + std::string(64, 'a') + "\n");
  EXPECT_EQ(Daemon(data(), program, {"--listen", "0.0.0.0:0"}).End(0), 2);
  EXPECT_EQ(Daemon(data(), program, {"--listen", "0.0.0.0:0", "--insecure"}).End(SIGTERM), 0);
  EXPECT_EQ(Daemon(data(), program, {"--listen", "0.0.0.0:0", "--tokens", tokens}).End(SIGTERM), 0);
}

TEST_F(DaemonTest, FinishesAfterAKillWhatWasQueued) {
  const std::filesystem::path program =
      Program("echo $$ >> $test/pids; [ -e $test/go ] || exec sleep 1000" + kBakes);
  Daemon killed(data(), program);
  ASSERT_NE(killed.port(), 0);
  const std::string running = killed.client().PostScene();
  killed.client().WaitFor(running, "running");
  const std::string queued = killed.client().PostScene();
  EXPECT_TRUE(Eventually([&] { return Lines("pids") == 1; }));
  EXPECT_EQ(killed.End(SIGKILL), -SIGKILL);
  EXPECT_TRUE(Eventually([&] { return ChildrenAreGone(); })) << "the child dies with its server";

  WriteFile(folder() / "go", "");
  Daemon next(data(), program);
  ASSERT_NE(next.port(), 0);
  next.client().WaitFor(running, "succeeded");
  next.client().WaitFor(queued, "succeeded");
  EXPECT_EQ(Lines("pids"), 3);
  EXPECT_EQ(next.client().Get(queued + "/scene").body, "glTF baked");
}

TEST_F(DaemonTest, KeepsAResultThatWasThereBeforeTheKill) {
  const std::filesystem::path program = Program("echo $$ >> $test/pids" + kBakes);
  Daemon killed(data(), program);
  ASSERT_NE(killed.port(), 0);
  const std::string job = killed.client().PostScene();
  killed.client().WaitFor(job, "succeeded");
  EXPECT_EQ(killed.End(SIGKILL), -SIGKILL);

  Daemon next(data(), program);
  ASSERT_NE(next.port(), 0);
  EXPECT_EQ(next.client().Get(job).Json().at("status"), "succeeded");
  EXPECT_EQ(next.client().Get(job + "/scene").body, "glTF baked");
  EXPECT_EQ(Lines("pids"), 1) << "it is not baked twice";
  ExpectNothingLeftOver(job);
}

TEST_F(DaemonTest, GivesUpAJobThatItsServerHasNotOutlivedThreeTimes) {
  const std::filesystem::path program =
      Program("echo $$ >> $test/pids; [ -e $test/go ] || exec sleep 1000" + kBakes);
  std::string job;
  for (int attempt = 1; attempt <= 3; ++attempt) {
    Daemon daemon(data(), program);
    ASSERT_NE(daemon.port(), 0);
    job = job.empty() ? daemon.client().PostScene() : job;
    EXPECT_TRUE(Eventually([&] { return Lines("pids") == attempt; }));
    daemon.End(SIGKILL);
    EXPECT_TRUE(Eventually([&] { return ChildrenAreGone(); }));
  }
  WriteFile(folder() / "go", "");
  Daemon last(data(), program);
  ASSERT_NE(last.port(), 0);
  EXPECT_EQ(last.client().WaitFor(job, "failed").at("error").at("detail"),
            "gave up after 3 attempts: the last one's worker was lost");
  last.client().WaitFor(last.client().PostScene(), "succeeded");
}

TEST_F(DaemonTest, LeavesNothingOfAnUploadThatAKillBrokeOff) {
  const std::filesystem::path program = Program(kBakes);
  {
    Daemon killed(data(), program);
    ASSERT_NE(killed.port(), 0);
    std::thread uploader([&] {
      killed.client().Request("POST", "/v1/bakes",
                              "Content-Type: model/gltf-binary\r\nContent-Length: 100000\r\n",
                              Glb("half of it"));
    });
    EXPECT_TRUE(Eventually([&] {
      return std::filesystem::exists(data() / "jobs") && !std::filesystem::is_empty(data() / "jobs");
    }));
    killed.End(SIGKILL);
    uploader.join();
  }
  Daemon next(data(), program);
  ASSERT_NE(next.port(), 0);
  EXPECT_TRUE(std::filesystem::is_empty(data() / "jobs"));
}

}  // namespace
}  // namespace radbake::server
