#include "server/queue.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>

#include "tests/server/service_test.h"

namespace radbake::server {
namespace {

void Add(Queue& queue, const std::string& id) {
  queue.Add({id, "", "s", std::nullopt});
}

class QueueTest : public testing::Test {
 protected:
  std::filesystem::path file() const { return folder_.path() / "jobs.sqlite"; }

 private:
  TemporaryFolder folder_;
};

TEST_F(QueueTest, GivesTheOldestJobFirstAndEachOnce) {
  Queue queue(file());
  Add(queue, "b");
  Add(queue, "a");
  EXPECT_EQ(queue.Claim().value().id, "b");
  EXPECT_EQ(queue.Claim().value().id, "a");
  EXPECT_FALSE(queue.Claim());
}

TEST_F(QueueTest, GivesOwnersTheirTurns) {
  Queue queue(file());
  for (const char* id : {"a1", "a2", "a3", "b1", "b2", "c1"}) {
    queue.Add({id, std::string(1, id[0]), "s", std::nullopt});
  }
  const auto claim = [&] { return queue.Claim().value().id; };
  const auto finish = [&](const std::string& id) {
    EXPECT_TRUE(queue.Finish(id, 1, Status::kSucceeded, {}, std::nullopt));
    return id;
  };
  EXPECT_EQ(finish(claim()), "a1");
  EXPECT_EQ(finish(claim()), "b1") << "it is older than c1, and a has just had a turn";
  EXPECT_EQ(finish(claim()), "c1");
  EXPECT_EQ(finish(claim()), "a2");
  EXPECT_EQ(claim(), "b2");
  queue.Add({"b3", "b", "s", std::nullopt});
  EXPECT_EQ(claim(), "a3");
  EXPECT_EQ(claim(), "b3") << "nobody waits for want of a turn";
  EXPECT_FALSE(queue.Claim());
}

TEST_F(QueueTest, PutsAReleasedJobBackInItsPlace) {
  Queue queue(file());
  Add(queue, "first");
  Add(queue, "second");
  queue.Claim();
  EXPECT_TRUE(queue.Release("first", 1, 2));
  const Job job = queue.Claim().value();
  EXPECT_EQ(job.id, "first");
  EXPECT_EQ(job.crashes, 2);
  EXPECT_EQ(job.status, Status::kRunning);
}

TEST_F(QueueTest, RemembersEverythingOfAJob) {
  {
    Queue queue(file());
    queue.Add({"a", "me", "upload/scene.glb", std::nullopt});
    queue.Claim();
    queue.Finish("a", 1, Status::kFailed, {"solve", 0.5, {{"error", 0.1}}}, BadScene("no \"triangles\"\xFF"));
  }
  Queue queue(file());
  const Job job = queue.Find("a").value();
  EXPECT_EQ(job.status, Status::kFailed);
  EXPECT_EQ(job.scene, "upload/scene.glb");
  EXPECT_EQ(job.owner, "me");
  EXPECT_EQ(job.attempt, 1);
  EXPECT_EQ(job.live.phase, "solve");
  EXPECT_EQ(job.live.statistics, nlohmann::json({{"error", 0.1}}));
  EXPECT_EQ(job.expires, *job.ended + std::chrono::hours(24));
  EXPECT_EQ(job.live.progress, 0.5);
  EXPECT_EQ(job.problem.value().status, 422);
  EXPECT_EQ(job.problem.value().detail, "no \"triangles\"\xEF\xBF\xBD");
  EXPECT_LE(job.created, job.started.value());
  EXPECT_LE(job.started.value(), job.ended.value());
}

TEST_F(QueueTest, ChangesNoJobThatHasLeftTheStateItWasIn) {
  Queue queue(file());
  Add(queue, "a");
  EXPECT_FALSE(queue.Finish("a", 1, Status::kSucceeded, {}, std::nullopt)) << "it does not run";
  EXPECT_FALSE(queue.Release("a", 1, 1));
  queue.Claim();
  EXPECT_TRUE(queue.Cancel("a", {"", 0.25, {}}));
  EXPECT_FALSE(queue.Finish("a", 1, Status::kSucceeded, {}, std::nullopt)) << "it is canceled";
  EXPECT_FALSE(queue.Release("a", 1, 1));
  EXPECT_FALSE(queue.Cancel("a", {}));
  EXPECT_EQ(queue.Find("a").value().status, Status::kCanceled);
  EXPECT_EQ(queue.Find("a").value().live.progress, 0.25);
  EXPECT_TRUE(queue.Remove("a"));
  EXPECT_FALSE(queue.Remove("a"));
  EXPECT_FALSE(queue.Cancel("a", {}));
}

TEST_F(QueueTest, ReleasesWhatRanAndNothingElse) {
  Queue queue(file());
  for (const char* id : {"done", "canceled", "running", "queued"}) {
    Add(queue, id);
  }
  queue.Claim();
  queue.Finish("done", 1, Status::kSucceeded, {}, std::nullopt);
  queue.Claim();
  queue.Cancel("canceled", {});
  queue.Claim();
  EXPECT_EQ(queue.ReleaseAll(), 1U);
  EXPECT_EQ(queue.Find("done").value().status, Status::kSucceeded);
  EXPECT_EQ(queue.Find("canceled").value().status, Status::kCanceled);
  EXPECT_EQ(queue.Find("running").value().status, Status::kQueued);
  EXPECT_FALSE(queue.Find("running").value().started);
}

TEST_F(QueueTest, FencesAnAttemptThatHasLostItsJob) {
  Queue queue(file());
  Add(queue, "a");
  queue.Claim();
  queue.ReleaseAll();
  EXPECT_EQ(queue.Claim().value().attempt, 2);
  EXPECT_FALSE(queue.Finish("a", 1, Status::kSucceeded, {}, std::nullopt));
  EXPECT_FALSE(queue.Release("a", 1, 1));
  EXPECT_TRUE(queue.Finish("a", 2, Status::kSucceeded, {}, std::nullopt));
}

TEST_F(QueueTest, ForgetsWhatHasBeenKeptLongEnough) {
  Queue queue(file(), std::chrono::hours(1));
  for (const char* id : {"ended", "canceled", "running", "queued"}) {
    Add(queue, id);
  }
  queue.Claim();
  queue.Finish("ended", 1, Status::kSucceeded, {}, std::nullopt);
  queue.Claim();
  queue.Cancel("canceled", {});
  queue.Claim();
  EXPECT_TRUE(queue.Forget(Now()).empty());
  EXPECT_THAT(queue.Forget(Now() + std::chrono::hours(2)),
              testing::UnorderedElementsAre("ended", "canceled"));
  EXPECT_FALSE(queue.Find("ended"));
  EXPECT_TRUE(queue.Find("running") && queue.Find("queued"));
}

TEST_F(QueueTest, KeepsAKeyForADayEachOwnerItsOwn) {
  Queue queue(file());
  const auto add = [&](const std::string& id, const std::string& owner, const std::string& digest) {
    return queue.Add({id, owner, "s", IdempotencyKey{"key", digest}});
  };
  EXPECT_EQ(add("a", "one", "x").kind, Added::Kind::kNew);
  EXPECT_EQ(add("b", "one", "x").kind, Added::Kind::kSame);
  EXPECT_EQ(add("b", "one", "x").job.id, "a");
  EXPECT_EQ(add("b", "one", "y").kind, Added::Kind::kOther);
  EXPECT_EQ(add("b", "two", "y").kind, Added::Kind::kNew);
  queue.Forget(Now() + std::chrono::hours(23));
  EXPECT_EQ(add("c", "one", "x").kind, Added::Kind::kSame);
  queue.Forget(Now() + std::chrono::hours(25));
  EXPECT_EQ(add("c", "one", "x").kind, Added::Kind::kNew);
  EXPECT_TRUE(queue.Find("a")) << "the key is forgotten, not its job";
}

TEST_F(QueueTest, ShowsEachOwnerItsOwnJobs) {
  Queue queue(file());
  queue.Add({"a", "one", "s", std::nullopt});
  queue.Add({"b", "two", "s", std::nullopt});
  const std::vector<Job> jobs = queue.List({"two", std::nullopt, "", 10});
  ASSERT_EQ(jobs.size(), 1U);
  EXPECT_EQ(jobs[0].id, "b");
  EXPECT_TRUE(queue.List({"two", std::nullopt, Cursor(jobs[0]), 10}).empty());
  EXPECT_TRUE(queue.List({"two", Status::kFailed, "", 10}).empty());
}

TEST_F(QueueTest, TakesOverAQueueOfItsFirstVersion) {
  sqlite3* database = nullptr;
  ASSERT_EQ(sqlite3_open(file().c_str(), &database), SQLITE_OK);
  const char* const first = R"(
    CREATE TABLE jobs (sequence INTEGER PRIMARY KEY AUTOINCREMENT, id TEXT NOT NULL UNIQUE,
      status TEXT NOT NULL CHECK (status IN ('queued', 'running', 'succeeded', 'failed', 'canceled')),
      scene TEXT NOT NULL, crashes INTEGER NOT NULL DEFAULT 0, progress REAL NOT NULL DEFAULT 0,
      created INTEGER NOT NULL, started INTEGER, ended INTEGER, problem TEXT) STRICT;
    INSERT INTO jobs (id, status, scene, created, ended) VALUES ('old', 'succeeded', 's', 1000, 2000);
    INSERT INTO jobs (id, status, scene, created) VALUES ('new', 'queued', 's', 3000);
    PRAGMA user_version = 1;)";
  ASSERT_EQ(sqlite3_exec(database, first, nullptr, nullptr, nullptr), SQLITE_OK);
  sqlite3_close(database);
  Queue queue(file());
  EXPECT_EQ(queue.Find("old").value().expires,
            Time(std::chrono::milliseconds(2000) + std::chrono::hours(24)));
  EXPECT_EQ(queue.Claim().value().id, "new");
}

TEST_F(QueueTest, RefusesAQueueOfALaterVersion) {
  Queue{file()};
  sqlite3* database = nullptr;
  ASSERT_EQ(sqlite3_open(file().c_str(), &database), SQLITE_OK);
  sqlite3_exec(database, "PRAGMA user_version = 99", nullptr, nullptr, nullptr);
  sqlite3_close(database);
  EXPECT_THROW(Queue{file()}, QueueError);
}

TEST_F(QueueTest, RefusesAFileThatIsNoDatabase) {
  WriteFile(file(), std::string(5000, 'x'));
  EXPECT_THROW(Queue{file()}, QueueError);
}

}  // namespace
}  // namespace radbake::server
