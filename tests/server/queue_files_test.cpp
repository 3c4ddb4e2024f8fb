// The files of jobs: the upload on its way to the worker, the result, and what goes with a job.
#include <gmock/gmock.h>

#include "server/queue_postgres.h"
#include "tests/server/queue_test.h"

namespace radbake::server {
namespace {

using testing::ElementsAre;
using testing::UnorderedElementsAre;

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

TEST_P(QueueTest, ForgetsAFewAtATime) {
  const auto queue = Open();
  constexpr int kJobs = 2 * Queue::kForgottenAtOnce + 3;
  for (int i = 0; i < kJobs; ++i) {
    const std::string id = "job" + std::to_string(i);
    Add(*queue, id);
    queue->Cancel(id, std::nullopt);
  }
  std::vector<std::size_t> forgotten;
  while (forgotten.empty() || forgotten.back() > 0) {
    forgotten.push_back(queue->Forget(std::chrono::hours(25)).size());
  }
  EXPECT_THAT(forgotten, testing::ElementsAre(20, 20, 3, 0));
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

}  // namespace
}  // namespace radbake::server
