// Several radbaked on one queue, and a database that goes and comes back.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <memory>
#include <set>

#include "tests/server/postgres_test.h"
#include "tests/server/service_test.h"

namespace radbake::server {
namespace {

class ShareTest : public testing::Test {
 protected:
  // $test: the test's own folder; $$: the process.
  std::filesystem::path Program(const std::string& script) const {
    return WriteProgram(folder() / "radbake", "test=" + folder().string() + "\n" + script);
  }
  const std::filesystem::path& folder() const { return folder_.path(); }
  bool There(const std::string& name) const {
    return Eventually([&] { return std::filesystem::exists(folder() / name); });
  }
  std::vector<std::string> Lines(const std::string& name) const {
    std::istringstream text(ReadFile(folder() / name));
    std::vector<std::string> lines;
    for (std::string line; std::getline(text, line);) {
      lines.push_back(line);
    }
    return lines;
  }

 private:
  TemporaryFolder folder_;
};

using SqliteShareTest = ShareTest;

TEST_F(SqliteShareTest, ApiAndWorkerShareADataFolder) {
  const std::filesystem::path program = Program(kBakes);
  const Daemon api(folder() / "data", program, {"--role", "api"});
  ASSERT_NE(api.port(), 0);
  const std::string job = api.client().PostScene();
  EXPECT_EQ(api.client().Get("/readyz").status, 200);
  const Daemon worker(folder() / "data", program, {"--role", "worker"});
  ASSERT_NE(worker.port(), 0);
  api.client().WaitFor(job, "succeeded");
  EXPECT_EQ(api.client().Get(job + "/scene").body, "glTF baked");
  EXPECT_EQ(worker.client().Get("/healthz").status, 200);
  EXPECT_EQ(worker.client().Get("/readyz").status, 200);
  EXPECT_EQ(worker.client().Get(job).status, 404);
  EXPECT_EQ(worker.client().Post(Glb(), "model/gltf-binary").status, 404);
  EXPECT_EQ(Daemon(folder() / "data", program, {"--role", "worker"}).End(0), 1) << "there is one already";
  EXPECT_EQ(Daemon(folder() / "data", program, {"--role", "none"}).End(0), 2);
}

class PostgresShareTest : public ShareTest {
 protected:
  // A server of its own, for tests that kill it.
  PostgresServer& server() {
    if (own_ == nullptr) {
      own_ = std::make_unique<PostgresServer>();
    }
    return *own_;
  }
  std::string MakeDatabase() { return PostgresServer::Shared().MakeDatabase(); }
  std::unique_ptr<Daemon> Start(const std::string& name, const std::string& url, const std::string& script,
                                std::vector<std::string> more = {}) const {
    more.insert(more.end(), {"--database", url, "--lease", "1s"});
    return std::make_unique<Daemon>(
        folder() / name,
        WriteProgram(folder() / ("radbake-" + name),
                     "test=" + folder().string() + "\nme=" + name + "\n" + script),
        more);
  }

 private:
  std::unique_ptr<PostgresServer> own_;
};

TEST_F(PostgresShareTest, EachWorkerTakesItsShareAndEachApiAnswersForAll) {
  const std::string url = MakeDatabase();
  const std::string bakes = "echo $me >> $test/runs; sleep 0.05" + kBakes;
  const auto one = Start("one", url, bakes, {"--workers", "1"});
  const auto two = Start("two", url, bakes, {"--workers", "1", "--role", "worker"});
  const auto three = Start("three", url, bakes, {"--role", "api"});
  ASSERT_TRUE(one->port() != 0 && two->port() != 0 && three->port() != 0);
  std::vector<std::string> jobs;
  for (int i = 0; i < 20; ++i) {
    jobs.push_back((i % 2 == 0 ? one : three)->client().PostScene());
  }
  for (const std::string& job : jobs) {
    three->client().WaitFor(job, "succeeded");
    EXPECT_EQ(one->client().Get(job + "/scene").body, "glTF baked");
    EXPECT_EQ(three->client().Request("GET", job + "/scene", "Range: bytes=5-8\r\n").body, "bake");
  }
  const std::vector<std::string> runs = Lines("runs");
  EXPECT_EQ(runs.size(), jobs.size()) << "each is baked once";
  EXPECT_THAT(std::set<std::string>(runs.begin(), runs.end()), testing::ElementsAre("one", "two"));
  for (const char* name : {"one", "two", "three"}) {
    EXPECT_TRUE(Eventually([&] {
      return (!std::filesystem::exists(folder() / name / "work") ||
              std::filesystem::is_empty(folder() / name / "work")) &&
             std::filesystem::is_empty(folder() / name / "drafts");
    })) << name
        << " keeps no files";
  }
}

TEST_F(PostgresShareTest, CancelsAndDeletesWhatRunsElsewhere) {
  const std::string url = MakeDatabase();
  const auto api = Start("api", url, kBakes, {"--role", "api"});
  const auto worker = Start(
      "worker", url, "echo '{\"progress\":0.5,\"phase\":\"solve\"}'; echo $$ >> $test/pids; exec sleep 1000",
      {"--role", "worker", "--workers", "1"});
  const Client client = api->client();
  const std::string canceled = client.PostScene();
  const std::string deleted = client.PostScene();
  EXPECT_TRUE(Eventually([&] { return client.Get(canceled).Json().at("progress") == 0.5; }))
      << "what is told there is seen here";
  EXPECT_EQ(client.Request("POST", canceled + "/cancel").Json().at("progress"), 0.5);
  EXPECT_TRUE(Eventually([&] { return Lines("pids").size() == 2; })) << "the worker is free for the next";
  EXPECT_EQ(client.Request("DELETE", deleted).status, 204);
  const std::string last = client.PostScene();
  client.WaitFor(last, "running");
  EXPECT_EQ(client.Get(canceled).Json().at("status"), "canceled");
}

TEST_F(PostgresShareTest, FindsWhatNobodyHasHintedAt) {
  const std::string url = MakeDatabase();
  const auto service = Start("service", url, kBakes);
  const Client client = service->client();
  const std::string job = client.PostScene();
  client.WaitFor(job, "succeeded");
  // Past the queue, which would notify its workers.
  RunSql(url, "UPDATE radbake.jobs SET status = 'queued', started = NULL, ended = NULL, expires = NULL");
  EXPECT_TRUE(Eventually([&] { return client.Get(job).Json().at("attempt") == 2; }));
  client.WaitFor(job, "succeeded");
}

TEST_F(PostgresShareTest, TakesOverFromAWorkerThatIsNoMore) {
  const std::string url = MakeDatabase();
  const auto api = Start("api", url, kBakes, {"--role", "api"});
  const auto killed = Start("killed", url, "touch $test/started; exec sleep 1000", {"--role", "worker"});
  const std::string job = api->client().PostScene();
  EXPECT_TRUE(There("started"));
  killed->End(SIGKILL);
  const auto next = Start("next", url, kBakes, {"--role", "worker"});
  const nlohmann::json done = api->client().WaitFor(job, "succeeded");
  EXPECT_EQ(done.at("attempt"), 2);
}

TEST_F(PostgresShareTest, LeavesAWorkerThatHangsWithoutItsJob) {
  const std::string url = MakeDatabase();
  const auto api = Start("api", url, kBakes, {"--role", "api"});
  const auto hung =
      Start("hung", url, "echo $$ >> $test/pids; exec sleep 1000", {"--role", "worker", "--workers", "1"});
  const std::string job = api->client().PostScene();
  EXPECT_TRUE(Eventually([&] { return Lines("pids").size() == 1; }));
  hung->Signal(SIGSTOP);
  const auto next = Start("next", url, "printf second > $test/second" + kBakes, {"--role", "worker"});
  api->client().WaitFor(job, "succeeded");
  hung->Signal(SIGCONT);
  EXPECT_TRUE(Eventually([&] { return !std::filesystem::exists("/proc/" + Lines("pids").at(0)); }))
      << "its child is stopped when it sees that the job is no longer its own";
  EXPECT_EQ(api->client().Get(job).Json().at("status"), "succeeded");
  EXPECT_EQ(api->client().Get(job).Json().at("attempt"), 2);
}

TEST_F(PostgresShareTest, GoesOnWhenTheDatabaseHasGoneAndComeBack) {
  const std::string url = server().MakeDatabase();
  const auto service =
      Start("service", url,
            "echo run >> $test/runs; touch $test/started; while [ ! -e $test/go ]; do sleep 0.02; "
            "done" +
                kBakes,
            {"--workers", "1"});
  const Client client = service->client();
  const std::string running = client.PostScene();
  const std::string queued = client.PostScene();
  EXPECT_TRUE(There("started"));
  const Descriptor watcher = Connect(service->port(), "GET " + running + "/events HTTP/1.1\r\n\r\n");
  std::string events;
  EXPECT_TRUE(ReceiveUntil(watcher, "event: job", events));
  server().Kill();
  for (const char* method : {"GET", "DELETE"}) {
    const Answer answer = client.Request(method, running);
    EXPECT_EQ(answer.status, 503);
    EXPECT_EQ(answer.headers.at("content-type"), "application/problem+json");
    EXPECT_TRUE(answer.headers.contains("retry-after"));
  }
  EXPECT_EQ(client.Post(Glb(), "model/gltf-binary").status, 503);
  EXPECT_EQ(client.Get("/readyz").status, 503);
  EXPECT_EQ(client.Get("/healthz").status, 200);
  const Answer metrics = client.Get("/metrics");
  EXPECT_EQ(metrics.status, 200);
  EXPECT_THAT(metrics.body, testing::HasSubstr("\nradbaked_queue_up 0\n"));
  EXPECT_TRUE(Eventually([&] { return std::filesystem::is_empty(folder() / "service/drafts"); }));
  WriteFile(folder() / "go", "");  // the bake ends while there is nobody to tell
  EXPECT_TRUE(Eventually([&] {
    const std::vector<std::string> files = ListTree(folder() / "service/work");
    return std::any_of(files.begin(), files.end(),
                       [](const auto& file) { return file.ends_with("attempt/statistics.json"); });
  }));
  server().Start();
  EXPECT_EQ(client.WaitFor(running, "succeeded").at("attempt"), 1);
  client.WaitFor(queued, "succeeded");
  EXPECT_EQ(Lines("runs").size(), 2U) << "nothing is baked twice";
  EXPECT_TRUE(ReceiveUntil(watcher, R"("status":"succeeded")", events)) << events;
  const std::string log = service->Log();
  const std::size_t said = log.find("cannot be watched");
  EXPECT_NE(said, std::string::npos);
  EXPECT_EQ(log.find("cannot be watched", said + 1), std::string::npos) << "once is enough";
  EXPECT_EQ(client.Get(running + "/scene").body, "glTF baked");
}

TEST_F(PostgresShareTest, WaitsForADatabaseThatComesLate) {
  const std::string url = server().MakeDatabase();
  server().Kill();
  const auto service = Start("service", url, kBakes);
  ASSERT_NE(service->port(), 0);
  EXPECT_EQ(service->client().Get("/readyz").status, 503);
  server().Start();
  EXPECT_TRUE(Eventually([&] { return service->client().Get("/readyz").status == 200; }));
  service->client().WaitFor(service->client().PostScene(), "succeeded");
}

}  // namespace
}  // namespace radbake::server
