// A PostgreSQL that hangs, and a network that swallows what is said to it: who asks gets an answer, and when
// it goes on all does.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <csignal>
#include <memory>
#include <thread>

#include "server/queue_postgres_pool.h"
#include "tests/server/postgres_test.h"
#include "tests/server/service_test.h"

namespace radbake::server {
namespace {

using testing::HasSubstr;

sockaddr_un SocketIn(const std::filesystem::path& folder) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  (folder / ".s.PGSQL.5432").string().copy(address.sun_path, sizeof address.sun_path - 1);
  return address;
}

// The socket of a PostgreSQL server once more, through which nothing passes while the network is down.
class Network {
 public:
  Network(std::filesystem::path folder, std::filesystem::path server)
      : folder_(std::move(folder)), server_(std::move(server)) {
    std::filesystem::create_directory(folder_);
    const sockaddr_un address = SocketIn(folder_);
    listener_ = Descriptor(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
    EXPECT_EQ(::bind(listener_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    EXPECT_EQ(::listen(listener_.get(), 64), 0);
    thread_ = std::thread([this] { Pass(); });
  }
  ~Network() {
    over_ = true;
    thread_.join();
  }
  Network(const Network&) = delete;
  Network& operator=(const Network&) = delete;

  void SetDown(bool down) { down_ = down; }

 private:
  struct Pair {
    std::array<Descriptor, 2> ends;
    bool broken = false;
  };

  void Pass() {
    constexpr int kTurn = 10;
    std::vector<Pair> pairs;
    while (!over_) {
      std::vector<pollfd> events = {{listener_.get(), POLLIN, 0}};
      for (const Pair& pair : pairs) {
        events.push_back({pair.ends[0].get(), POLLIN, 0});
        events.push_back({pair.ends[1].get(), POLLIN, 0});
      }
      if (down_ || ::poll(events.data(), events.size(), kTurn) <= 0) {
        std::this_thread::sleep_for(std::chrono::milliseconds(down_ ? kTurn : 0));
        continue;
      }
      for (std::size_t i = 0; i < pairs.size(); ++i) {
        for (const std::size_t end : {0U, 1U}) {
          if (events.at(1 + 2 * i + end).revents != 0) {
            pairs[i].broken = !Move(pairs[i].ends.at(end), pairs[i].ends.at(1 - end)) || pairs[i].broken;
          }
        }
      }
      std::erase_if(pairs, [](const Pair& pair) { return pair.broken; });
      if (events[0].revents != 0) {
        const sockaddr_un address = SocketIn(server_);
        Pair pair{{Descriptor(::accept4(listener_.get(), nullptr, nullptr, SOCK_CLOEXEC)),
                   Descriptor(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0))}};
        if (::connect(pair.ends[1].get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0) {
          pairs.push_back(std::move(pair));
        }
      }
    }
  }

  static bool Move(const Descriptor& from, const Descriptor& to) {
    std::array<char, 65536> bytes{};
    const ssize_t count = ::recv(from.get(), bytes.data(), bytes.size(), 0);
    return count > 0 &&
           ::send(to.get(), bytes.data(), static_cast<std::size_t>(count), MSG_NOSIGNAL) == count;
  }

  std::filesystem::path folder_;
  std::filesystem::path server_;
  Descriptor listener_;
  std::atomic<bool> down_ = false;
  std::atomic<bool> over_ = false;
  std::thread thread_;
};

class PostgresHangTest : public testing::Test {
 protected:
  // One of its own, for tests that halt it.
  PostgresServer& server() {
    if (server_ == nullptr) {
      server_ = std::make_unique<PostgresServer>();
    }
    return *server_;
  }
  static std::string MakeDatabase() { return PostgresServer::Shared().MakeDatabase(); }
  const std::filesystem::path& folder() const { return folder_.path(); }
  // $test: the test's own folder.
  std::unique_ptr<Daemon> Start(const std::string& name, const std::string& url, const std::string& script,
                                std::vector<std::string> more) const {
    more.insert(more.end(), {"--database", url, "--workers", "1", "--grace", "1s"});
    return std::make_unique<Daemon>(
        folder() / name,
        WriteProgram(folder() / ("radbake-" + name), "test=" + folder().string() + "\n" + script), more);
  }
  bool There(const std::string& name) const {
    return Eventually([&] { return std::filesystem::exists(folder() / name); });
  }
  std::ptrdiff_t CountRuns() const {
    const std::string runs = ReadFile(folder() / "runs");
    return std::count(runs.begin(), runs.end(), '\n');
  }
  bool Baked(const std::string& name) const {
    return Eventually([&] {
      const std::vector<std::string> files = ListTree(folder() / name / "work");
      return std::any_of(files.begin(), files.end(),
                         [](const auto& file) { return file.ends_with("attempt/statistics.json"); });
    });
  }
  static void ExpectUnavailable(const Answer& answer) {
    EXPECT_EQ(answer.status, 503) << answer.body;
    EXPECT_EQ(answer.headers.at("content-type"), "application/problem+json");
    EXPECT_TRUE(answer.headers.contains("retry-after"));
  }

 private:
  TemporaryFolder folder_;
  std::unique_ptr<PostgresServer> server_;
};

const std::string kWaitsToBake =
    "echo run >> $test/runs; touch $test/started; while [ ! -e $test/go ]; do sleep 0.02; done" + kBakes;

TEST_F(PostgresHangTest, AnswersMeanwhileAndGoesOnAfterwards) {
  const auto service =
      Start("service", server().MakeDatabase(), kWaitsToBake, {"--database-timeout", "2s", "--lease", "1s"});
  ASSERT_NE(service->port(), 0);
  const Client client = service->client();
  const std::string running = client.PostScene();
  const std::string queued = client.PostScene();
  EXPECT_TRUE(There("started"));
  const Descriptor watcher = Connect(service->port(), "GET " + running + "/events HTTP/1.1\r\n\r\n");
  std::string events;
  EXPECT_TRUE(ReceiveUntil(watcher, "event: job", events));
  server().Halt();
  for (const char* method : {"GET", "DELETE", "GET"}) {
    ExpectUnavailable(client.Request(method, running));
  }
  ExpectUnavailable(client.Get("/v1/bakes"));
  ExpectUnavailable(client.Post(Glb(), "model/gltf-binary"));
  ExpectUnavailable(client.Get("/readyz"));
  EXPECT_EQ(client.Get("/healthz").status, 200);
  EXPECT_THAT(client.Get("/metrics").body, HasSubstr("\nradbaked_queue_up 0\n"));
  WriteFile(folder() / "go", "");  // the bake ends while there is nobody to tell
  EXPECT_TRUE(Baked("service"));
  server().Resume();
  EXPECT_EQ(client.WaitFor(running, "succeeded").at("attempt"), 1) << "it was its own all the time";
  client.WaitFor(queued, "succeeded");
  EXPECT_EQ(CountRuns(), 2) << "nothing is baked twice";
  EXPECT_EQ(client.Get("/readyz").status, 200);
  EXPECT_TRUE(ReceiveUntil(watcher, R"("status":"succeeded")", events)) << events;
  client.WaitFor(client.PostScene(), "succeeded");
}

TEST_F(PostgresHangTest, SaysThatItLivesWhileEveryRequestWaits) {
  const auto service =
      Start("service", server().MakeDatabase(), kBakes, {"--database-timeout", "10m", "--role", "api"});
  const Client client = service->client();
  const std::string job = client.PostScene();
  server().Halt();
  constexpr std::size_t kMoreThanThreads = 80;
  std::vector<Descriptor> waiting;
  for (std::size_t i = 0; i < kMoreThanThreads; ++i) {
    waiting.push_back(Connect(service->port(), "GET " + job + " HTTP/1.1\r\nHost: h\r\n\r\n"));
  }
  EXPECT_EQ(client.Get("/healthz").status, 200);
  for (const Descriptor& one : waiting) {
    pollfd event{one.get(), POLLIN, 0};
    EXPECT_EQ(::poll(&event, 1, 0), 0) << "nobody has given up so soon";
  }
  server().Resume();
  for (const Descriptor& one : waiting) {
    std::string answer;
    EXPECT_TRUE(ReceiveUntil(one, "\r\n\r\n", answer));
    EXPECT_THAT(answer, HasSubstr("HTTP/1.1 200 OK")) << "nor was there a need";
  }
}

TEST_F(PostgresHangTest, StopsMeanwhile) {
  const std::string url = server().MakeDatabase();
  auto service = Start("service", url, kWaitsToBake, {"--database-timeout", "2s"});
  const std::string job = service->client().PostScene();
  EXPECT_TRUE(There("started"));
  server().Halt();
  EXPECT_EQ(service->End(SIGTERM), 0);
  server().Resume();
  WriteFile(folder() / "go", "");
  service = Start("service", url, kWaitsToBake, {});
  service->client().WaitFor(job, "succeeded");
}

TEST_F(PostgresHangTest, GivesBackWhatItHasClaimedWithoutAnAnswer) {
  const std::string url = MakeDatabase();
  const auto service = Start("service", url, kWaitsToBake, {"--lease", "7d"});
  const Client client = service->client();
  client.PostScene();
  EXPECT_TRUE(There("started"));
  const std::string stray = client.PostScene();
  std::string worker = ReadFile(folder() / "service/worker");
  worker.erase(worker.find_last_not_of('\n') + 1);
  RunSql(url, "UPDATE radbake.jobs SET status = 'running', attempt = 1, worker = '" + worker +
                  "' WHERE status = 'queued'");
  client.WaitFor(stray, "queued");
  WriteFile(folder() / "go", "");
  EXPECT_EQ(client.WaitFor(stray, "succeeded").at("attempt"), 2);
  EXPECT_EQ(RunSql(url, "SELECT max(crashes) FROM radbake.jobs"), "0") << "it was no fault of the job's";
}

TEST_F(PostgresHangTest, LeavesAWorkerWithoutItsJobThatNobodyHears) {
  const std::string url = server().MakeDatabase();
  Network network(folder() / "network", server().folder());
  const auto api = Start("api", url, kBakes, {"--role", "api"});
  const auto cut = Start("cut", "postgresql:///test1?user=radbake&host=" + (folder() / "network").string(),
                         "echo $$ > $test/pid; touch $test/started; exec sleep 1000",
                         {"--database-timeout", "2s", "--lease", "1s"});
  const std::string job = api->client().PostScene();
  EXPECT_TRUE(There("started"));
  network.SetDown(true);
  ExpectUnavailable(cut->client().Get(job));
  ExpectUnavailable(cut->client().Get("/readyz"));
  EXPECT_EQ(cut->client().Get("/healthz").status, 200);
  const auto next = Start("next", url, kBakes, {"--role", "worker", "--lease", "1s"});
  EXPECT_EQ(api->client().WaitFor(job, "succeeded").at("attempt"), 2);
  const std::string process = "/proc/" + std::to_string(std::stoi(ReadFile(folder() / "pid")));
  EXPECT_TRUE(std::filesystem::exists(process)) << "it knows nothing of that";
  network.SetDown(false);
  EXPECT_TRUE(Eventually([&] { return !std::filesystem::exists(process); }));
  EXPECT_TRUE(Eventually([&] { return cut->client().Get(job).status == 200; }));
  EXPECT_EQ(api->client().Get(job).Json().at("attempt"), 2);
  EXPECT_EQ(api->client().Get(job + "/scene").body, "glTF baked");
}

TEST_F(PostgresHangTest, GivesUpAStatementAndItsConnection) {
  PostgresConnection connection(MakeDatabase(), std::chrono::seconds(2));
  EXPECT_TRUE(connection.Alive());
  EXPECT_THROW(connection.Run("SELECT pg_sleep(1000)"), DatabaseSilent);
  EXPECT_FALSE(connection.Alive());
  EXPECT_THROW(connection.Run("SELECT 1"), QueueError);
}

TEST_F(PostgresHangTest, GivesUpALockButNotTheConnection) {
  const std::string url = MakeDatabase();
  RunSql(url, "CREATE TABLE public.locked (number integer)");
  PostgresConnection one(url, std::chrono::seconds(2));
  PostgresConnection other(url, std::chrono::seconds(2));
  one.Execute("BEGIN; LOCK TABLE public.locked");
  try {
    other.Run("SELECT * FROM public.locked");
    ADD_FAILURE() << "it is locked";
  } catch (const QueueError& error) {
    EXPECT_THAT(error.what(), HasSubstr("lock timeout"));
  }
  EXPECT_TRUE(other.Alive());
}

TEST_F(PostgresHangTest, GoesOnWithAnotherConnection) {
  PostgresPool pool(MakeDatabase(), std::chrono::seconds(2), [](PostgresConnection&) {});
  const auto run = [&](const char* sql) {
    pool.With([&](PostgresConnection& connection) { connection.Run(sql); });
  };
  run("SELECT 1");
  EXPECT_THROW(run("SELECT pg_sleep(1000)"), DatabaseSilent);
  EXPECT_TRUE(Eventually([&] {
    try {
      run("SELECT 1");
      return true;
    } catch (const QueueError&) {
      return false;  // it counts as away for a moment
    }
  }));
}

}  // namespace
}  // namespace radbake::server
