// What a client sees of the queue: its own jobs, and the one that its key has made.
#include <gmock/gmock.h>

#include <atomic>
#include <thread>

#include "tests/server/queue_test.h"

namespace radbake::server {
namespace {

using testing::ElementsAre;
using testing::Pair;

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

}  // namespace
}  // namespace radbake::server
