// Who holds a job and how it comes to its end, as the queue promises it (server/queue.h), in both databases.
#include "tests/server/queue_test.h"

#include <gmock/gmock.h>
#include <sqlite3.h>

#include <atomic>
#include <mutex>
#include <set>

#include "server/queue_postgres.h"
#include "server/queue_sqlite.h"
#include "tests/server/postgres_test.h"

namespace radbake::server {

void RunInSqlite(const std::filesystem::path& file, const std::string& sql) {
  sqlite3* database = nullptr;
  ASSERT_EQ(sqlite3_open(file.c_str(), &database), SQLITE_OK);
  EXPECT_EQ(sqlite3_exec(database, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK) << sql;
  sqlite3_close(database);
}

std::string ReadAll(StoredFile& file, std::size_t most) {
  std::string bytes;
  while (bytes.size() < file.size()) {
    bytes += file.Read(bytes.size(), most);
  }
  return bytes;
}

std::unique_ptr<Queue> QueueTest::Open(std::chrono::milliseconds keep) {
  if (!Postgres()) {
    return std::make_unique<SqliteQueue>(data(), keep);
  }
  if (url_.empty()) {
    url_ = PostgresServer::Shared().MakeDatabase();
  }
  return std::make_unique<PostgresQueue>(url_, keep);
}

void QueueTest::Run(const std::string& sql) const {
  if (Postgres()) {
    RunSql(url_, "SET search_path TO radbake;" + sql);
  } else {
    RunInSqlite(data() / "jobs.sqlite", sql);
  }
}

std::filesystem::path QueueTest::Draft(const std::string& id, const std::string& scene) const {
  const std::filesystem::path folder = data() / "jobs" / id;
  std::filesystem::create_directories(folder / "upload/textures");
  WriteFile(folder / "parameters.json", "{}");
  WriteFile(folder / "upload/scene.gltf", scene);
  WriteFile(folder / "upload/textures/a.png", "png");
  return folder;
}

std::filesystem::path QueueTest::Results(const std::string& scene) const {
  const std::filesystem::path folder = data() / "attempt";
  std::filesystem::create_directories(folder);
  WriteFile(folder / kBakedFile, scene);
  WriteFile(folder / kStatisticsFile, "{}");
  return folder;
}

namespace {

INSTANTIATE_TEST_SUITE_P(In, QueueTest, testing::Values("Sqlite", "Postgres"),
                         [](const auto& database) { return std::string(database.param); });

TEST_P(QueueTest, GivesTheOldestJobFirstAndEachOnce) {
  const auto queue = Open();
  Add(*queue, "b");
  Add(*queue, "a");
  EXPECT_EQ(queue->Claim(kWorker).value().id, "b");
  EXPECT_EQ(queue->Claim(kWorker).value().id, "a");
  EXPECT_FALSE(queue->Claim(kWorker));
}

TEST_P(QueueTest, GivesOwnersTheirTurns) {
  const auto queue = Open();
  for (const char* id : {"a1", "a2", "a3", "b1", "b2", "c1"}) {
    Add(*queue, id, std::string(1, id[0]));
  }
  const auto claim = [&] { return queue->Claim(kWorker).value().id; };
  const auto finish = [&](const std::string& id) {
    EXPECT_TRUE(Succeed(*queue, id, 1));
    return id;
  };
  EXPECT_EQ(finish(claim()), "a1");
  EXPECT_EQ(finish(claim()), "b1") << "it is older than c1, and a has just had a turn";
  EXPECT_EQ(finish(claim()), "c1");
  EXPECT_EQ(finish(claim()), "a2");
  EXPECT_EQ(claim(), "b2");
  Add(*queue, "b3", "b");
  EXPECT_EQ(claim(), "a3");
  EXPECT_EQ(claim(), "b3") << "nobody waits for want of a turn";
  EXPECT_FALSE(queue->Claim(kWorker));
}

TEST_P(QueueTest, GivesEachJobToOneOfManyWhoClaimAtOnce) {
  constexpr int kJobs = 40;
  const auto queue = Open();
  const auto other = Open();
  for (int i = 0; i < kJobs; ++i) {
    Add(*queue, "job" + std::to_string(i), std::to_string(i % 3));
  }
  std::mutex mutex;
  std::multiset<std::string> claimed;
  std::vector<std::thread> threads;
  for (Queue* const one : {queue.get(), queue.get(), other.get(), other.get()}) {
    threads.emplace_back([&, one] {
      while (const std::optional<Job> job = one->Claim(kWorker)) {
        const std::lock_guard lock(mutex);
        claimed.insert(job->id);
      }
    });
  }
  for (std::thread& thread : threads) {
    thread.join();
  }
  EXPECT_EQ(claimed.size(), std::size_t{kJobs});
  EXPECT_EQ(std::set<std::string>(claimed.begin(), claimed.end()).size(), std::size_t{kJobs});
}

TEST_P(QueueTest, PutsAReleasedJobBackInItsPlace) {
  const auto queue = Open();
  Add(*queue, "first");
  Add(*queue, "second");
  queue->Claim(kWorker);
  EXPECT_TRUE(queue->Release({"first", 1}));
  const Job job = queue->Claim(kWorker).value();
  EXPECT_EQ(job.id, "first");
  EXPECT_EQ(job.crashes, 0);
  EXPECT_EQ(job.status, Status::kRunning);
}

TEST_P(QueueTest, FailsAJobAfterItsThirdAttemptWithoutAnAnswer) {
  const auto queue = Open();
  Add(*queue, "a");
  Problem reason = BakeFailed("it was killed");
  reason.log = "line\n\"quoted\"\n";
  for (int attempt = 1; attempt < Queue::kAttempts; ++attempt) {
    queue->Claim(kWorker);
    EXPECT_TRUE(queue->Crash({"a", attempt}, reason));
    const Job job = queue->Find("a").value();
    EXPECT_EQ(job.status, Status::kQueued);
    EXPECT_EQ(job.crashes, attempt);
    EXPECT_FALSE(job.problem || job.ended || job.started);
  }
  queue->Claim(kWorker);
  EXPECT_TRUE(queue->Release({"a", Queue::kAttempts})) << "that is no attempt of the job's";
  queue->Claim(kWorker);
  EXPECT_FALSE(queue->Crash({"a", Queue::kAttempts}, reason));
  EXPECT_TRUE(queue->Crash({"a", Queue::kAttempts + 1}, reason));
  const Job job = queue->Find("a").value();
  EXPECT_EQ(job.status, Status::kFailed);
  EXPECT_EQ(job.problem.value().detail, "it was killed");
  EXPECT_EQ(job.problem.value().log, reason.log);
  EXPECT_EQ(job.expires.value(), job.ended.value() + std::chrono::hours(24));
  EXPECT_FALSE(queue->Claim(kWorker));
}

TEST_P(QueueTest, RemembersEverythingOfAJob) {
  {
    const auto queue = Open();
    Add(*queue, "a", "me");
    queue->Claim(kWorker);
    queue->Finish({"a", 1},
                  {Status::kFailed, {"solve", 0.1, {{"error", 0.1}}}, BadScene("no \"triangles\"\xFF")}, "");
  }
  const auto queue = Open();
  const Job job = queue->Find("a").value();
  EXPECT_EQ(job.status, Status::kFailed);
  EXPECT_EQ(job.scene, "upload/scene.gltf");
  EXPECT_EQ(job.owner, "me");
  EXPECT_EQ(job.attempt, 1);
  EXPECT_EQ(job.live.phase, "solve");
  EXPECT_EQ(job.live.progress, 0.1);
  EXPECT_EQ(job.live.statistics, nlohmann::json({{"error", 0.1}}));
  EXPECT_EQ(job.expires, *job.ended + std::chrono::hours(24));
  EXPECT_EQ(job.problem.value().status, 422);
  EXPECT_EQ(job.problem.value().detail, "no \"triangles\"\xEF\xBF\xBD");
  EXPECT_LE(job.created, job.started.value());
  EXPECT_LE(job.started.value(), job.ended.value());
}

TEST_P(QueueTest, ChangesNoJobThatHasLeftTheStateItWasIn) {
  const auto queue = Open();
  Add(*queue, "a");
  EXPECT_FALSE(Succeed(*queue, "a", 1)) << "it does not run";
  EXPECT_FALSE(queue->Release({"a", 1}));
  EXPECT_FALSE(queue->Beat({"a", 1}, {}));
  queue->Claim(kWorker);
  EXPECT_TRUE(queue->Cancel("a", Live{"", 0.25, {}}));
  EXPECT_FALSE(Succeed(*queue, "a", 1)) << "it is canceled";
  EXPECT_FALSE(queue->Release({"a", 1}));
  EXPECT_FALSE(queue->Crash({"a", 1}, BakeFailed("")));
  EXPECT_FALSE(queue->Beat({"a", 1}, {"", 0.5, {}}));
  EXPECT_FALSE(queue->Cancel("a", std::nullopt));
  EXPECT_EQ(queue->Find("a").value().status, Status::kCanceled);
  EXPECT_EQ(queue->Find("a").value().live.progress, 0.25);
  EXPECT_EQ(queue->Open("a", kBakedFile), nullptr);
  EXPECT_TRUE(queue->Remove("a"));
  EXPECT_FALSE(queue->Remove("a"));
  EXPECT_FALSE(queue->Cancel("a", std::nullopt));
}

TEST_P(QueueTest, KeepsWhatWasToldLastOfACanceledJobThatRunsElsewhere) {
  const auto queue = Open();
  Add(*queue, "a");
  queue->Claim(kWorker);
  EXPECT_TRUE(queue->Beat({"a", 1}, {"solve", 0.5, {{"error", 0.25}}}));
  EXPECT_TRUE(queue->Cancel("a", std::nullopt));
  const Live live = queue->Find("a").value().live;
  EXPECT_EQ(live.phase, "solve");
  EXPECT_EQ(live.progress, 0.5);
  EXPECT_EQ(live.statistics, nlohmann::json({{"error", 0.25}}));
}

TEST_P(QueueTest, TakesBackWhatAWorkerHeldAndNothingElse) {
  const auto queue = Open();
  for (const char* id : {"done", "canceled", "its", "others", "queued"}) {
    Add(*queue, id);
  }
  queue->Claim(kWorker);
  Succeed(*queue, "done", 1);
  queue->Claim(kWorker);
  queue->Cancel("canceled", std::nullopt);
  queue->Claim(kWorker);
  queue->Claim("other");
  EXPECT_EQ(queue->TakeBackFrom(kWorker, BakeFailed("lost")), 1U);
  EXPECT_EQ(queue->Find("done").value().status, Status::kSucceeded);
  EXPECT_EQ(queue->Find("canceled").value().status, Status::kCanceled);
  EXPECT_EQ(queue->Find("others").value().status, Status::kRunning);
  EXPECT_EQ(queue->Find("its").value().status, Status::kQueued);
  EXPECT_EQ(queue->Find("its").value().crashes, 1);
  EXPECT_FALSE(queue->Find("its").value().started);
}

TEST_P(QueueTest, TakesBackOnlyFromWhomHasNotBeatenSince) {
  const auto queue = Open();
  Add(*queue, "a");
  queue->Claim(kWorker);
  const std::vector<Held> before = queue->ListHeld();
  ASSERT_EQ(before.size(), 1U);
  EXPECT_EQ(before[0].attempt.id, "a");
  EXPECT_EQ(before[0].attempt.number, 1);
  EXPECT_EQ(before[0].worker, kWorker);
  EXPECT_TRUE(queue->Beat({"a", 1}, {}));
  EXPECT_FALSE(queue->TakeBack(before[0], BakeFailed("lost")));
  const std::vector<Held> after = queue->ListHeld();
  EXPECT_FALSE(after[0] == before[0]);
  EXPECT_TRUE(queue->TakeBack(after[0], BakeFailed("lost")));
  EXPECT_FALSE(queue->TakeBack(after[0], BakeFailed("lost")));
  EXPECT_TRUE(queue->ListHeld().empty());
  EXPECT_FALSE(queue->Beat({"a", 1}, {}));
}

TEST_P(QueueTest, FencesAnAttemptThatHasLostItsJob) {
  const auto queue = Open();
  Add(*queue, "a");
  queue->Claim(kWorker);
  queue->TakeBackFrom(kWorker, BakeFailed("lost"));
  EXPECT_EQ(queue->Claim(kWorker).value().attempt, 2);
  EXPECT_FALSE(Succeed(*queue, "a", 1, "of the first"));
  EXPECT_FALSE(queue->Finish({"a", 1}, {Status::kFailed, {}, BakeFailed("")}, ""));
  EXPECT_FALSE(queue->Release({"a", 1}));
  EXPECT_FALSE(queue->Crash({"a", 1}, BakeFailed("")));
  EXPECT_FALSE(queue->Beat({"a", 1}, {"", 0.75, {}}));
  EXPECT_EQ(queue->Find("a").value().live.progress, 0);
  EXPECT_TRUE(Succeed(*queue, "a", 2, "of the second"));
  EXPECT_EQ(ReadAll(*queue->Open("a", kBakedFile), 100), "of the second");
}

TEST_P(QueueTest, EndsNoJobBeforeItsBeginWhateverIsDoneToTheClock) {
  const auto queue = Open();
  for (const char* id : {"a", "b", "c"}) {
    Add(*queue, id);
  }
  // As if the clock had been set back by an hour after they came.
  Run("UPDATE jobs SET created = created + 3600000");
  queue->Cancel("c", std::nullopt);
  queue->Claim(kWorker);
  EXPECT_TRUE(Succeed(*queue, "a", 1));
  for (int attempt = 1; attempt <= Queue::kAttempts; ++attempt) {
    queue->Claim(kWorker);
    queue->Crash({"b", attempt}, BakeFailed(""));
  }
  for (const char* id : {"a", "b", "c"}) {
    const Job job = queue->Find(id).value();
    EXPECT_TRUE(Ended(job.status));
    EXPECT_LE(job.created, job.started.value_or(job.created)) << id;
    EXPECT_LE(job.started.value_or(job.created), job.ended.value()) << id;
    EXPECT_LT(job.ended.value(), job.expires.value()) << id;
  }
}

TEST_P(QueueTest, HintsAtWhatMayBeNew) {
  const auto queue = Open();
  std::atomic<int> hints = 0;
  queue->OnChange([&] { ++hints; });
  Add(*queue, "a");
  EXPECT_TRUE(Eventually([&] { return hints > 0; }));
  if (Postgres()) {
    EXPECT_TRUE(Eventually([&] {
      const int before = hints;
      Add(*Open(), "of another instance " + std::to_string(before));
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
      return hints > before;
    }));
  }
  queue->OnChange({});
  const int before = hints;
  Add(*queue, "b");
  EXPECT_EQ(hints, before);
}

}  // namespace
}  // namespace radbake::server
