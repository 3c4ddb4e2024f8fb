// Databases of other versions, and what is none.
#include <gtest/gtest.h>

#include "server/queue_postgres.h"
#include "server/queue_sqlite.h"
#include "tests/server/queue_test.h"

namespace radbake::server {
namespace {

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
