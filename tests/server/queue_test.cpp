// What the queue promises (server/queue.h), in both databases.
#include "server/queue.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>

#include <atomic>
#include <mutex>
#include <set>

#include "server/queue_postgres.h"
#include "server/queue_sqlite.h"
#include "tests/server/postgres_test.h"
#include "tests/server/service_test.h"

namespace radbake::server {
namespace {

using testing::ElementsAre;
using testing::Pair;
using testing::UnorderedElementsAre;

const std::string kWorker = "worker";

void RunInSqlite(const std::filesystem::path& file, const std::string& sql) {
  sqlite3* database = nullptr;
  ASSERT_EQ(sqlite3_open(file.c_str(), &database), SQLITE_OK);
  EXPECT_EQ(sqlite3_exec(database, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK) << sql;
  sqlite3_close(database);
}

class QueueTest : public testing::TestWithParam<const char*> {
 protected:
  static bool Postgres() { return GetParam() == std::string("Postgres"); }
  const std::filesystem::path& data() const { return folder_.path(); }

  std::unique_ptr<Queue> Open(std::chrono::milliseconds keep = std::chrono::hours(24)) {
    if (!Postgres()) {
      return std::make_unique<SqliteQueue>(data(), keep);
    }
    if (url_.empty()) {
      url_ = PostgresServer::Shared().MakeDatabase();
    }
    return std::make_unique<PostgresQueue>(url_, keep);
  }

  // A statement of its own, past the queue.
  void Run(const std::string& sql) const {
    if (Postgres()) {
      RunSql(url_, "SET search_path TO radbake;" + sql);
    } else {
      RunInSqlite(data() / "jobs.sqlite", sql);
    }
  }

  // The folder of a new job with its upload.
  std::filesystem::path Draft(const std::string& id, const std::string& scene = "scene") const {
    const std::filesystem::path folder = data() / "jobs" / id;
    std::filesystem::create_directories(folder / "upload/textures");
    WriteFile(folder / "parameters.json", "{}");
    WriteFile(folder / "upload/scene.gltf", scene);
    WriteFile(folder / "upload/textures/a.png", "png");
    return folder;
  }
  Added Add(Queue& queue, const std::string& id, const std::string& owner = "",
            const std::optional<IdempotencyKey>& key = std::nullopt) const {
    return queue.Add({id, owner, "upload/scene.gltf", key}, Draft(id));
  }
  // What a bake has written.
  std::filesystem::path Results(const std::string& scene) const {
    const std::filesystem::path folder = data() / "attempt";
    std::filesystem::create_directories(folder);
    WriteFile(folder / kBakedFile, scene);
    WriteFile(folder / kStatisticsFile, "{}");
    return folder;
  }
  bool Succeed(Queue& queue, const std::string& id, int attempt, const std::string& scene = "baked") const {
    return queue.Finish({id, attempt}, {Status::kSucceeded, {}, std::nullopt}, Results(scene));
  }

 private:
  TemporaryFolder folder_;
  std::string url_;
};

INSTANTIATE_TEST_SUITE_P(In, QueueTest, testing::Values("Sqlite", "Postgres"),
                         [](const auto& database) { return std::string(database.param); });

std::string ReadAll(StoredFile& file, std::size_t most) {
  std::string bytes;
  while (bytes.size() < file.size()) {
    bytes += file.Read(bytes.size(), most);
  }
  return bytes;
}

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

TEST_P(QueueTest, HandsTheUploadToTheWorker) {
  const auto queue = Open();
  std::string scene(2 * PostgresQueue::kPiece + 123, '\0');
  for (std::size_t i = 0; i < scene.size(); ++i) {
    scene[i] = static_cast<char>(i * i >> 7U);
  }
  const std::filesystem::path draft = Draft("a", scene);
  WriteFile(draft / "upload/empty", "");
  queue->Add({"a", "", "upload/scene.gltf", std::nullopt}, draft);
  EXPECT_EQ(queue->KeepsFolder("a"), std::filesystem::exists(draft));
  for (const char* folder : {"one", "two"}) {
    queue->Fetch("a", data() / folder);
    EXPECT_THAT(ListTree(data() / folder),
                ElementsAre("parameters.json", "upload", "upload/empty", "upload/scene.gltf",
                            "upload/textures", "upload/textures/a.png"));
    EXPECT_EQ(ReadFile(data() / folder / "upload/scene.gltf"), scene);
    EXPECT_EQ(ReadFile(data() / folder / "upload/textures/a.png"), "png");
  }
}

TEST_P(QueueTest, SaysThatAnUploadIsLost) {
  const auto queue = Open();
  try {
    queue->Fetch("none", data() / "work");
    FAIL() << "it is not there";
  } catch (const std::filesystem::filesystem_error& error) {
    EXPECT_EQ(error.code(), std::errc::no_such_file_or_directory);
  }
}

TEST_P(QueueTest, KeepsTheResult) {
  std::string scene(PostgresQueue::kPiece * 40 + 1, 'x');
  scene[PostgresQueue::kPiece] = 'y';
  {
    const auto queue = Open();
    Add(*queue, "a");
    queue->Claim(kWorker);
    EXPECT_EQ(queue->Open("a", kBakedFile), nullptr);
    EXPECT_TRUE(Succeed(*queue, "a", 1, scene));
  }
  const auto queue = Open();
  const auto file = queue->Open("a", kBakedFile);
  ASSERT_NE(file, nullptr);
  EXPECT_EQ(file->size(), scene.size());
  EXPECT_TRUE(ReadAll(*file, 100'000) == scene);
  EXPECT_EQ(file->Read(PostgresQueue::kPiece - 1, 1), "x");
  EXPECT_EQ(file->Read(PostgresQueue::kPiece, 1), "y");
  EXPECT_EQ(file->Read(scene.size() - 1, 10), "x");
  EXPECT_EQ(ReadAll(*queue->Open("a", kStatisticsFile), 100), "{}");
  EXPECT_EQ(queue->Open("a", "none"), nullptr);
}

TEST_P(QueueTest, ForgetsWhatHasBeenKeptLongEnough) {
  const auto queue = Open(std::chrono::hours(1));
  for (const char* id : {"ended", "canceled", "running", "queued"}) {
    Add(*queue, id);
  }
  queue->Claim(kWorker);
  Succeed(*queue, "ended", 1);
  queue->Claim(kWorker);
  queue->Cancel("canceled", std::nullopt);
  queue->Claim(kWorker);
  EXPECT_TRUE(queue->Forget().empty());
  EXPECT_THAT(queue->Forget(std::chrono::hours(2)), UnorderedElementsAre("ended", "canceled"));
  EXPECT_FALSE(queue->Find("ended"));
  EXPECT_EQ(queue->Open("ended", kBakedFile), nullptr);
  EXPECT_TRUE(queue->Find("running") && queue->Find("queued"));
}

TEST_P(QueueTest, LeavesNothingOfARemovedJob) {
  const auto queue = Open();
  Add(*queue, "a", "me", IdempotencyKey{"key", "x"});
  queue->Claim(kWorker);
  Succeed(*queue, "a", 1);
  EXPECT_TRUE(queue->Remove("a"));
  EXPECT_TRUE(std::filesystem::is_empty(data() / "jobs"));
  if (Postgres()) {
    Run("SELECT 1 / (CASE count(*) WHEN 0 THEN 1 ELSE 0 END) FROM pieces");
  }
}

TEST_P(QueueTest, KeepsAKeyForADayEachOwnerItsOwn) {
  const auto queue = Open();
  const auto add = [&](const std::string& id, const std::string& owner, const std::string& digest) {
    return Add(*queue, id, owner, IdempotencyKey{"key", digest});
  };
  EXPECT_EQ(add("a", "one", "x").kind, Added::Kind::kNew);
  EXPECT_EQ(add("b", "one", "x").kind, Added::Kind::kSame);
  EXPECT_EQ(add("b", "one", "x").job.id, "a");
  EXPECT_EQ(add("b", "one", "y").kind, Added::Kind::kOther);
  EXPECT_EQ(add("b", "two", "y").kind, Added::Kind::kNew);
  queue->Forget(std::chrono::hours(23));
  EXPECT_EQ(add("c", "one", "x").kind, Added::Kind::kSame);
  queue->Forget(std::chrono::hours(25));
  EXPECT_EQ(add("c", "one", "x").kind, Added::Kind::kNew);
  EXPECT_TRUE(queue->Find("a")) << "the key is forgotten, not its job";
}

TEST_P(QueueTest, MakesOneJobOfAKeyThatComesManyTimesAtOnce) {
  const auto queue = Open();
  std::atomic<int> made = 0;
  std::vector<std::thread> threads;
  for (int i = 0; i < 6; ++i) {
    threads.emplace_back([&, i] {
      const Added added = Add(*queue, "job" + std::to_string(i), "me", IdempotencyKey{"key", "x"});
      made += added.kind == Added::Kind::kNew ? 1 : 0;
    });
  }
  for (std::thread& thread : threads) {
    thread.join();
  }
  EXPECT_EQ(made, 1);
  EXPECT_EQ(queue->List({"me", std::nullopt, "", 10}).size(), 1U);
}

TEST_P(QueueTest, ShowsEachOwnerItsOwnJobsNewestFirst) {
  const auto queue = Open();
  Add(*queue, "a", "one");
  Add(*queue, "b", "two");
  Add(*queue, "c", "two");
  Run("UPDATE jobs SET created = created + 3600000 WHERE id = 'b'");  // the clock was set back since
  const std::vector<Job> jobs = queue->List({"two", std::nullopt, "", 10});
  ASSERT_EQ(jobs.size(), 2U);
  EXPECT_EQ(jobs[0].id, "c");
  EXPECT_EQ(jobs[1].id, "b");
  EXPECT_EQ(queue->List({"two", std::nullopt, Cursor(jobs[0]), 10}).at(0).id, "b");
  EXPECT_TRUE(queue->List({"two", std::nullopt, Cursor(jobs[1]), 10}).empty());
  EXPECT_TRUE(queue->List({"two", Status::kFailed, "", 10}).empty());
  EXPECT_EQ(queue->CountQueued("two").all, 3U);
  EXPECT_EQ(queue->CountQueued("two").of_owner, 2U);
  queue->Claim(kWorker);
  EXPECT_THAT(queue->Count(),
              ElementsAre(Pair(Status::kQueued, 2U), Pair(Status::kRunning, 1U), Pair(Status::kSucceeded, 0U),
                          Pair(Status::kFailed, 0U), Pair(Status::kCanceled, 0U)));
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

TEST_P(QueueTest, RefusesAQueueOfALaterVersion) {
  Open()->Count();
  Run(Postgres() ? "UPDATE version SET number = 99" : "PRAGMA user_version = 99");
  EXPECT_THROW(Open()->Count(), QueueError);
}

class SqliteQueueTest : public testing::Test {
 protected:
  const std::filesystem::path& data() const { return folder_.path(); }
  std::filesystem::path file() const { return data() / "jobs.sqlite"; }

 private:
  TemporaryFolder folder_;
};

TEST_F(SqliteQueueTest, TakesOverAQueueOfItsFirstVersion) {
  RunInSqlite(file(), R"(
    CREATE TABLE jobs (sequence INTEGER PRIMARY KEY AUTOINCREMENT, id TEXT NOT NULL UNIQUE,
      status TEXT NOT NULL CHECK (status IN ('queued', 'running', 'succeeded', 'failed', 'canceled')),
      scene TEXT NOT NULL, crashes INTEGER NOT NULL DEFAULT 0, progress REAL NOT NULL DEFAULT 0,
      created INTEGER NOT NULL, started INTEGER, ended INTEGER, problem TEXT) STRICT;
    INSERT INTO jobs (id, status, scene, created, ended) VALUES ('old', 'succeeded', 's', 1000, 2000);
    INSERT INTO jobs (id, status, scene, created) VALUES ('running', 'running', 's', 2500);
    INSERT INTO jobs (id, status, scene, created) VALUES ('new', 'queued', 's', 3000);
    PRAGMA user_version = 1;)");
  SqliteQueue queue(data());
  EXPECT_EQ(queue.Find("old").value().expires,
            Time(std::chrono::milliseconds(2000) + std::chrono::hours(24)));
  EXPECT_EQ(queue.Claim(kWorker).value().id, "running");
  EXPECT_EQ(queue.Claim(kWorker).value().id, "new");
}

TEST_F(SqliteQueueTest, RefusesAFileThatIsNoDatabase) {
  WriteFile(file(), std::string(5000, 'x'));
  EXPECT_THROW(SqliteQueue{data()}, QueueError);
}

TEST(PostgresQueueTest, RefusesAnUrlThatIsNone) {
  EXPECT_THROW(PostgresQueue("postgresql://[", std::chrono::hours(1)), QueueError);
  EXPECT_THROW(PostgresQueue("host", std::chrono::hours(1)), QueueError);
}

}  // namespace
}  // namespace radbake::server
