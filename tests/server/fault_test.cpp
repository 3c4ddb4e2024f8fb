// A disk that is full or cannot be written to, and a clock that is set: each leaves a clear state, and when
// it is over all goes on. The faults are made by tests/server/faults.cpp, which a sanitizer's library does
// not let in.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <cstdlib>
#include <memory>

#include "tests/server/service_test.h"

namespace radbake::server {
namespace {

class FaultTest : public testing::Test {
 protected:
  FaultTest() {
    ::setenv("LD_PRELOAD", RADBAKED_FAULTS, 1);
    ::setenv("RADBAKED_FAULT", fault().c_str(), 1);
    ::setenv("RADBAKED_FAULT_FOLDER", data().c_str(), 1);
  }
  ~FaultTest() override {
    for (const char* name : {"LD_PRELOAD", "RADBAKED_FAULT", "RADBAKED_FAULT_FOLDER"}) {
      ::unsetenv(name);
    }
  }
  const std::filesystem::path& folder() const { return folder_.path(); }
  std::filesystem::path data() const { return folder() / "data"; }
  std::filesystem::path fault() const { return folder() / "fault"; }
  // Appears whole: radbaked looks at it all the time.
  void Set(const std::string& what) const {
    WriteFile(folder() / "fault.new", what);
    std::filesystem::rename(folder() / "fault.new", fault());
  }
  void Heal() const { std::filesystem::remove(fault()); }
  std::unique_ptr<Daemon> Start() const {
    return std::make_unique<Daemon>(data(),
                                    WriteProgram(folder() / "radbake", "test=" + folder().string() + R"(
          echo run >> $test/runs
          while [ ! -e $test/go ]; do sleep 0.02; done
          printf 'glTF baked' > attempt/baked.glb || { echo 'radbake: no room' >&2; exit 1; }
          printf '{"version":"0"}' > attempt/statistics.json || exit 1)"),
                                    std::vector<std::string>{"--least-free", "1000000"});
  }
  void ExpectUnavailable(const Answer& answer) const {
    EXPECT_EQ(answer.status, 503) << answer.body;
    EXPECT_EQ(answer.headers.at("content-type"), "application/problem+json");
    EXPECT_TRUE(answer.headers.contains("retry-after"));
  }
  bool Runs(const std::string& runs) const {
    return Eventually([&] { return ReadFile(folder() / "runs") == runs; });
  }
  std::ptrdiff_t CountJobs() const {
    return std::distance(std::filesystem::directory_iterator(data() / "jobs"), {});
  }

 private:
  TemporaryFolder folder_;
};

// The shell that bakes here says that it is the scene's fault when it has no room: the exit code is its own.
TEST_F(FaultTest, WaitsForRoomOnAFullDisk) {
  const auto daemon = Start();
  ASSERT_NE(daemon->port(), 0);
  const Client client = daemon->client();
  const std::string running = client.PostScene();
  const std::string queued = client.PostScene();
  EXPECT_TRUE(Runs("run\n"));
  Set("full");
  ExpectUnavailable(client.Post(Glb(), "model/gltf-binary"));
  ExpectUnavailable(client.Request("POST", queued + "/cancel"));
  ExpectUnavailable(client.Get("/readyz"));
  EXPECT_EQ(client.Get(running).status, 200);
  EXPECT_EQ(CountJobs(), 2) << "nothing is left of the upload that had no room";
  WriteFile(folder() / "go", "");
  EXPECT_TRUE(Eventually([&] { return daemon->Log().find("no room") != std::string::npos; }));
  EXPECT_EQ(client.Get(running).Json().at("status"), "running") << "what cannot be written down is no news";
  Heal();
  EXPECT_EQ(client.WaitFor(running, "succeeded").at("attempt"), 2) << "it was no fault of the job's";
  client.WaitFor(queued, "succeeded");
  client.WaitFor(client.PostScene(), "succeeded");
  EXPECT_EQ(client.Get(running + "/scene").body, "glTF baked");
  EXPECT_EQ(client.Get("/readyz").status, 200);
}

TEST_F(FaultTest, ServesWhatItHasFromAReadOnlyFolder) {
  const auto daemon = Start();
  ASSERT_NE(daemon->port(), 0);
  const Client client = daemon->client();
  WriteFile(folder() / "go", "");
  const std::string done = client.PostScene();
  client.WaitFor(done, "succeeded");
  Set("read-only");
  ExpectUnavailable(client.Post(Glb(), "model/gltf-binary"));
  ExpectUnavailable(client.Request("DELETE", done));
  ExpectUnavailable(client.Get("/readyz"));
  EXPECT_EQ(client.Get(done + "/scene").body, "glTF baked");
  Heal();
  client.WaitFor(client.PostScene(), "succeeded");
  EXPECT_EQ(client.Request("DELETE", done).status, 204);
}

TEST_F(FaultTest, SaysAtTheStartThatItsFolderIsReadOnly) {
  std::filesystem::create_directories(data());
  Set("read-only");
  const auto daemon = Start();
  EXPECT_EQ(daemon->End(0), 1);
  EXPECT_THAT(daemon->Log(), testing::HasSubstr("Read-only file system"));
}

TEST_F(FaultTest, GoesOnWhenTheClockIsSetBackOrForth) {
  const auto daemon = Start();
  ASSERT_NE(daemon->port(), 0);
  const Client client = daemon->client();
  const std::string first = client.PostScene();
  EXPECT_TRUE(Runs("run\n"));
  const auto time = [&](const std::string& job, const char* name) {
    return client.Get(job).Json().at(name).get<std::string>();
  };
  const std::string created = time(first, "created_at");
  Set("-86400");
  WriteFile(folder() / "go", "");
  client.WaitFor(first, "succeeded");
  EXPECT_GE(time(first, "ended_at"), time(first, "started_at"));
  const std::string second = client.PostScene();
  client.WaitFor(second, "succeeded");
  EXPECT_LT(time(second, "created_at"), created) << "the clock was set";
  const nlohmann::json list = client.Get("/v1/bakes").Json().at("bakes");
  EXPECT_EQ(list.at(0).at("links").at("self"), second) << "the newest first, whatever the clock says";
  Set("3600");
  const std::string third = client.PostScene();
  client.WaitFor(third, "succeeded");
  EXPECT_GT(time(third, "created_at"), created);
  EXPECT_EQ(ReadFile(folder() / "runs"), "run\nrun\nrun\n") << "none was taken from its worker";
}

}  // namespace
}  // namespace radbake::server
