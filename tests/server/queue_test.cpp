#include "server/queue.h"

#include <gtest/gtest.h>

#include "tests/server/service_test.h"

namespace radbake::server {
namespace {

class QueueTest : public testing::Test {
 protected:
  std::filesystem::path file() const { return folder_.path() / "jobs.sqlite"; }

 private:
  TemporaryFolder folder_;
};

TEST_F(QueueTest, GivesTheOldestJobFirstAndEachOnce) {
  Queue queue(file());
  queue.Add("b", "s");
  queue.Add("a", "s");
  EXPECT_EQ(queue.Claim().value().id, "b");
  EXPECT_EQ(queue.Claim().value().id, "a");
  EXPECT_FALSE(queue.Claim());
}

TEST_F(QueueTest, PutsAReleasedJobBackInItsPlace) {
  Queue queue(file());
  queue.Add("first", "s");
  queue.Add("second", "s");
  queue.Claim();
  EXPECT_TRUE(queue.Release("first", 2));
  const Job job = queue.Claim().value();
  EXPECT_EQ(job.id, "first");
  EXPECT_EQ(job.crashes, 2);
  EXPECT_EQ(job.status, Status::kRunning);
}

TEST_F(QueueTest, RemembersEverythingOfAJob) {
  {
    Queue queue(file());
    queue.Add("a", "upload/scene.glb");
    queue.Claim();
    queue.Finish("a", Status::kFailed, 0.5, BadScene("no \"triangles\"\xFF"));
  }
  Queue queue(file());
  const Job job = queue.Find("a").value();
  EXPECT_EQ(job.status, Status::kFailed);
  EXPECT_EQ(job.scene, "upload/scene.glb");
  EXPECT_EQ(job.progress, 0.5);
  EXPECT_EQ(job.problem.value().status, 422);
  EXPECT_EQ(job.problem.value().detail, "no \"triangles\"\xEF\xBF\xBD");
  EXPECT_LE(job.created, job.started.value());
  EXPECT_LE(job.started.value(), job.ended.value());
}

TEST_F(QueueTest, ChangesNoJobThatHasLeftTheStateItWasIn) {
  Queue queue(file());
  queue.Add("a", "s");
  EXPECT_FALSE(queue.Finish("a", Status::kSucceeded, 1, std::nullopt)) << "it does not run";
  EXPECT_FALSE(queue.Release("a", 1));
  queue.Claim();
  EXPECT_TRUE(queue.Cancel("a", 0.25));
  EXPECT_FALSE(queue.Finish("a", Status::kSucceeded, 1, std::nullopt)) << "it is canceled";
  EXPECT_FALSE(queue.Release("a", 1));
  EXPECT_FALSE(queue.Cancel("a", 0));
  EXPECT_EQ(queue.Find("a").value().status, Status::kCanceled);
  EXPECT_EQ(queue.Find("a").value().progress, 0.25);
  EXPECT_TRUE(queue.Remove("a"));
  EXPECT_FALSE(queue.Remove("a"));
  EXPECT_FALSE(queue.Cancel("a", 0));
}

TEST_F(QueueTest, ReleasesWhatRanAndNothingElse) {
  Queue queue(file());
  for (const char* id : {"done", "canceled", "running", "queued"}) {
    queue.Add(id, "s");
  }
  queue.Claim();
  queue.Finish("done", Status::kSucceeded, 1, std::nullopt);
  queue.Claim();
  queue.Cancel("canceled", 0);
  queue.Claim();
  EXPECT_EQ(queue.ReleaseAll(), 1U);
  EXPECT_EQ(queue.Find("done").value().status, Status::kSucceeded);
  EXPECT_EQ(queue.Find("canceled").value().status, Status::kCanceled);
  EXPECT_EQ(queue.Find("running").value().status, Status::kQueued);
  EXPECT_FALSE(queue.Find("running").value().started);
}

TEST_F(QueueTest, RefusesAFileThatIsNoDatabase) {
  WriteFile(file(), std::string(5000, 'x'));
  EXPECT_THROW(Queue{file()}, QueueError);
}

}  // namespace
}  // namespace radbake::server
