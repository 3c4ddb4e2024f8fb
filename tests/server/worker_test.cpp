#include "server/worker.h"

#include <gtest/gtest.h>

namespace radbake::server {
namespace {

TEST(Progress, TakesOverALine) {
  Live live;
  ReadProgress(
      R"({"phase":"solve","progress":0.42,"error":0.05,"seconds":0.31,"iteration":{"pass":2},"new":1})",
      live);
  EXPECT_EQ(live.phase, "solve");
  EXPECT_EQ(live.progress, 0.42);
  EXPECT_EQ(live.statistics,
            nlohmann::json::parse(
                R"({"error":0.05,"seconds":0.31,"iteration":{"pass":2},"iterations":[{"pass":2}]})"));
}

TEST(Progress, KeepsTheLastIterations) {
  Live live;
  for (int pass = 0; pass < 10; ++pass) {
    const std::string line = R"({"iteration":{"pass":)" + std::to_string(pass) + "}}";
    ReadProgress(line, live);
    ReadProgress(line, live);  // told again with another phase: the same iteration
  }
  ASSERT_EQ(live.statistics.at("iterations").size(), kIterationsShown);
  EXPECT_EQ(live.statistics.at("iterations").front().at("pass"), 2);
  EXPECT_EQ(live.statistics.at("iterations").back().at("pass"), 9);
}

TEST(Progress, NeverFallsAndStaysInItsRange) {
  Live live;
  ReadProgress(R"({"progress":0.5})", live);
  ReadProgress(R"({"progress":0.25})", live);
  EXPECT_EQ(live.progress, 0.5);
  ReadProgress(R"({"progress":7})", live);
  EXPECT_EQ(live.progress, 1);
}

TEST(Progress, LeavesOutWhatIsNoProgress) {
  Live live;
  ReadProgress(R"({"phase":"solve","progress":0.5})", live);
  for (const char* line : {"", "hello", "[1]", R"({"phase":)", R"({"phase":3,"progress":"x"})", "null"}) {
    ReadProgress(line, live);
    EXPECT_EQ(live.phase, "solve") << line;
    EXPECT_EQ(live.progress, 0.5) << line;
  }
}

}  // namespace
}  // namespace radbake::server
