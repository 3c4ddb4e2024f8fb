// kill -9 of the server, of a worker or of the database, or a database that hangs, at random moments under
// load: every job that was taken ends once, in a right result; none is lost and none is there twice; no
// process and no file is left over.
//
// RADBAKED_KILL_ROUNDS says how many kills each test has; by hand:
//
//     RADBAKED_KILL_ROUNDS=200 build/release/bin/radbaked_tests --gtest_filter='*KillTest*'
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <csignal>
#include <cstdlib>
#include <memory>
#include <random>
#include <set>
#include <sstream>
#include <thread>

#include "tests/server/postgres_test.h"
#include "tests/server/service_test.h"

namespace radbake::server {
namespace {

constexpr int kClients = 2;
constexpr int kJobsOfAClient = 5;  // in a round
#if defined(RADBAKE_ADDRESS_SANITIZER) || defined(RADBAKE_THREAD_SANITIZER)
constexpr int kRounds = 2;
#else
constexpr int kRounds = 10;
#endif

enum class Target { kServer, kWorker, kDatabase, kDatabaseThatHangs };

struct Case {
  const char* name;
  bool postgres;
  Target target;
};

// What a client has been told of a job of its own.
struct Taken {
  std::string key;
  std::string scene;
  std::string path;
  nlohmann::json ended;
};

// The program, on the same folder and port each time.
class Restarted {
 public:
  Restarted(std::filesystem::path data, std::filesystem::path program, std::vector<std::string> flags)
      : data_(std::move(data)), program_(std::move(program)), flags_(std::move(flags)) {
    Start();
  }
  int port() const { return port_; }
  void Start() {
    std::vector<std::string> flags = flags_;
    if (port_ != 0) {
      flags.insert(flags.end(), {"--listen", "127.0.0.1:" + std::to_string(port_)});
    }
    daemon_ = std::make_unique<Daemon>(data_, program_, flags);
    ASSERT_NE(daemon_->port(), 0) << daemon_->Log();
    port_ = daemon_->port();
  }
  void Kill() { EXPECT_EQ(daemon_->End(SIGKILL), -SIGKILL); }
  void Stop() { EXPECT_EQ(daemon_->End(SIGTERM), 0); }

 private:
  std::filesystem::path data_;
  std::filesystem::path program_;
  std::vector<std::string> flags_;
  std::unique_ptr<Daemon> daemon_;
  std::atomic<int> port_ = 0;  // the clients ask on while it is started anew
};

class KillTest : public testing::TestWithParam<Case> {
 protected:
  KillTest()
      : program_(WriteProgram(folder_.path() / "radbake", "echo $$ >> " + (folder_.path() / "pids").string() +
                                                              R"(
      sleep 0.0$(($$ % 5))
      cp upload/scene.glb attempt/baked.glb
      printf '{"version":"0"}' > attempt/statistics.json)")) {
    std::vector<std::string> flags = {"--lease", "1s", "--grace", "0s"};
    if (GetParam().postgres) {
      server_ = std::make_unique<PostgresServer>();
      url_ = server_->MakeDatabase();
      flags.insert(flags.end(), {"--database", url_});
      if (GetParam().target == Target::kDatabaseThatHangs) {
        flags.insert(flags.end(), {"--database-timeout", "1s"});
      }
    }
    const bool apart = GetParam().postgres || GetParam().target == Target::kWorker;
    api_ = Start("data", flags, apart ? "api" : "all");
    if (apart) {
      workers_.push_back(Start(GetParam().postgres ? "one" : "data", flags, "worker"));
    }
    if (GetParam().postgres) {
      workers_.push_back(Start("two", flags, "worker"));
    }
  }

  std::unique_ptr<Restarted> Start(const std::string& name, std::vector<std::string> flags,
                                   const std::string& role) {
    data_.insert(folder_.path() / name);
    flags.insert(flags.end(), {"--role", role});
    return std::make_unique<Restarted>(folder_.path() / name, program_, flags);
  }

  Client client() const { return Client(api_->port()); }
  // As a client does that is told to come again.
  Answer Get(const std::string& path) const {
    Answer answer;
    EXPECT_TRUE(Eventually([&] { return (answer = client().Get(path)).status != 503; }));
    return answer;
  }

  // Posts until it is taken, as a client does that wants one bake and no two.
  Taken Post(const std::string& key) const {
    Taken taken{key, Glb(key), "", {}};
    const std::string head = "Content-Type: model/gltf-binary\r\nIdempotency-Key: " + key +
                             "\r\nContent-Length: " + std::to_string(taken.scene.size()) + "\r\n";
    EXPECT_TRUE(Eventually([&] {
      const Answer answer = client().Request("POST", "/v1/bakes", head, taken.scene);
      const bool accepted = answer.status == 202 || answer.status == 200;
      taken.path = accepted ? answer.headers.at("location") : "";
      EXPECT_TRUE(accepted || answer.status == 0 || answer.status == 503) << answer.body;
      return accepted;
    }));
    return taken;
  }

  void KillAndRestart(std::mt19937& random) {
    std::this_thread::sleep_for(std::chrono::milliseconds(random() % 250));
    const auto pause = std::chrono::milliseconds(random() % 50);
    if (GetParam().target == Target::kDatabase) {
      server_->Kill();
      std::this_thread::sleep_for(pause);
      server_->Start();
      return;
    }
    if (GetParam().target == Target::kDatabaseThatHangs) {
      server_->Halt();
      std::this_thread::sleep_for(std::chrono::milliseconds(200 + random() % 1500));
      server_->Resume();
      return;
    }
    Restarted& victim =
        GetParam().target == Target::kServer ? *api_ : *workers_.at(random() % workers_.size());
    victim.Kill();
    std::this_thread::sleep_for(pause);
    victim.Start();
  }

  void ExpectRightEnd(Taken& taken) const {
    SCOPED_TRACE(taken.path);
    EXPECT_TRUE(Eventually([&] {
      const Answer answer = client().Get(taken.path);
      taken.ended = answer.Json();
      return answer.status == 200 && !taken.ended.at("ended_at").is_null();
    })) << taken.ended;
    EXPECT_EQ(taken.ended.value("status", ""), "succeeded") << taken.ended;
    EXPECT_EQ(Get(taken.path + "/scene").body, taken.scene);
  }

  std::set<std::string> ListAll() const {
    std::set<std::string> ids;
    nlohmann::json next = "/v1/bakes?limit=1000";
    while (!next.is_null()) {
      const nlohmann::json page = Get(next.get<std::string>()).Json();
      for (const nlohmann::json& job : page.at("bakes")) {
        ids.insert(job.at("links").at("self").get<std::string>());
      }
      next = page.at("next");
    }
    return ids;
  }

  void ExpectNothingLeftOver(std::size_t jobs) const {
    std::istringstream pids(ReadFile(folder_.path() / "pids"));
    for (std::string pid; std::getline(pids, pid);) {
      const std::string command = ReadFile("/proc/" + pid + "/cmdline");
      EXPECT_EQ(command.find(program_.string()), std::string::npos) << "process " << pid << " is left over";
    }
    for (const std::filesystem::path& data : data_) {
      EXPECT_TRUE(!std::filesystem::exists(data / "work") || std::filesystem::is_empty(data / "work"));
      const std::filesystem::path files = data / (GetParam().postgres ? "drafts" : "jobs");
      EXPECT_EQ(std::distance(std::filesystem::directory_iterator(files), {}),
                static_cast<std::ptrdiff_t>(GetParam().postgres ? 0 : jobs));
    }
    if (!GetParam().postgres) {
      for (const auto& entry : std::filesystem::directory_iterator(folder_.path() / "data/jobs")) {
        EXPECT_THAT(ListTree(entry.path()),
                    testing::ElementsAre("baked.glb", "parameters.json", "statistics.json", "upload",
                                         "upload/scene.glb"));
      }
    } else {
      // Of each job the scene and its parameters, the result and its statistics, and a piece of each.
      EXPECT_EQ(RunSql(url_, "SELECT count(*) FROM radbake.pieces"), std::to_string(4 * jobs));
    }
  }

  TemporaryFolder folder_;
  std::filesystem::path program_;
  std::unique_ptr<PostgresServer> server_;
  std::string url_;
  std::set<std::filesystem::path> data_;
  std::unique_ptr<Restarted> api_;
  std::vector<std::unique_ptr<Restarted>> workers_;
};

INSTANTIATE_TEST_SUITE_P(Of, KillTest,
                         testing::Values(Case{"TheServerOnSqlite", false, Target::kServer},
                                         Case{"AWorkerOnSqlite", false, Target::kWorker},
                                         Case{"TheServerOnPostgres", true, Target::kServer},
                                         Case{"AWorkerOnPostgres", true, Target::kWorker},
                                         Case{"ThePostgresDatabase", true, Target::kDatabase},
                                         Case{"APostgresDatabaseThatHangs", true,
                                              Target::kDatabaseThatHangs}),
                         [](const auto& one) { return one.param.name; });

TEST_P(KillTest, EndsEachJobOnce) {
  const char* told = std::getenv("RADBAKED_KILL_ROUNDS");
  const int rounds = told == nullptr ? kRounds : std::atoi(told);
  ASSERT_GT(rounds, 0);
  const unsigned seed = std::random_device()();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937 random(seed);
  std::vector<Taken> all;
  int attempts = 0;
  for (int round = 0; round < rounds && !HasFailure(); ++round) {
    SCOPED_TRACE("round " + std::to_string(round));
    std::vector<Taken> taken(kClients * kJobsOfAClient);
    std::vector<std::thread> clients;
    for (int i = 0; i < kClients; ++i) {
      clients.emplace_back([&, i] {
        for (int j = i * kJobsOfAClient; j < (i + 1) * kJobsOfAClient; ++j) {
          taken[static_cast<std::size_t>(j)] = Post(std::to_string(round) + "-" + std::to_string(j));
        }
      });
    }
    KillAndRestart(random);
    for (std::thread& one : clients) {
      one.join();
    }
    for (Taken& one : taken) {
      ExpectRightEnd(one);
      attempts += one.ended.value("attempt", 0);
    }
    all.insert(all.end(), taken.begin(), taken.end());
  }
  std::set<std::string> paths;
  for (const Taken& one : all) {
    EXPECT_EQ(Get(one.path).Json(), one.ended) << "what has ended stays so";
    paths.insert(one.path);
  }
  EXPECT_EQ(paths.size(), all.size());
  EXPECT_EQ(ListAll(), paths);
  for (const auto& worker : workers_) {
    worker->Stop();
  }
  api_->Stop();
  ExpectNothingLeftOver(all.size());
  RecordProperty("jobs", static_cast<int>(all.size()));
  RecordProperty("attempts", attempts);
  std::printf("%d kills, %zu jobs, %d attempts\n", rounds, all.size(), attempts);
}

}  // namespace
}  // namespace radbake::server
