// The list of jobs, in pages.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/http_test.h"

namespace radbake::server {
namespace {

using ::testing::ElementsAre;

class ListTest : public HttpTest {};

TEST_F(ListTest, ListsJobsInPagesNewestFirst) {
  std::vector<std::string> jobs;
  for (int i = 0; i < 5; ++i) {
    jobs.push_back(client().PostScene());
    // Jobs of one millisecond have no order but that of their ids.
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  client().WaitFor(jobs[0], "running");
  std::vector<std::string> listed;
  std::string path = "/v1/bakes?limit=2";
  for (int page = 0; page < 3; ++page) {
    const Answer answer = client().Get(path);
    ASSERT_EQ(answer.status, 200) << answer.body;
    const nlohmann::json shown = answer.Json();
    for (const nlohmann::json& job : shown.at("bakes")) {
      listed.push_back(job.at("links").at("self"));
    }
    path = shown.at("next").is_string() ? shown.at("next").get<std::string>() : "";
    if (page == 0) {
      client().Request("DELETE", jobs[3]);  // where the page ended
    }
  }
  EXPECT_THAT(listed, ElementsAre(jobs[4], jobs[3], jobs[2], jobs[1], jobs[0]));
  EXPECT_EQ(path, "");
  const nlohmann::json running = client().Get("/v1/bakes?status=running").Json().at("bakes");
  ASSERT_EQ(running.size(), 1U);
  EXPECT_EQ(running[0].at("links").at("self"), jobs[0]);
  EXPECT_TRUE(client().Get("/v1/bakes?status=failed").Json().at("bakes").empty());
}

TEST_F(ListTest, NamesWhatAPageCannotTake) {
  ExpectProblem(client().Get("/v1/bakes?status=done"), 400, "status is \"done\"");
  ExpectProblem(client().Get("/v1/bakes?limit=0"), 400, "limit is \"0\"");
  ExpectProblem(client().Get("/v1/bakes?limit=1001"), 400, "limit");
  ExpectProblem(client().Get("/v1/bakes?limit=2x"), 400, "limit");
  ExpectProblem(client().Get("/v1/bakes?after=x"), 400, "after");
  ExpectProblem(client().Get("/v1/bakes?page=2"), 400, "\"page\"");
}

}  // namespace
}  // namespace radbake::server
