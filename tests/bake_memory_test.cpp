/// Whole bakes within a limit of memory.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <oneapi/tbb/global_control.h>

#include "solver/radbake.h"

namespace radbake {
namespace {

constexpr std::size_t kPlenty = 1'000'000'000;

gltf::Source CornellBox() {
  return gltf::ReadSource(RADBAKE_SOURCE_DIR "/scenes/cornell-box.glb");
}

Parameters Asking(double error, std::size_t probes) {
  Parameters parameters;
  parameters.error = error;
  parameters.basis = BasisOrder::kConstant;
  parameters.check = probes;
  return parameters;
}

BakeResult BakeIn(std::size_t limit, const Parameters& parameters) {
  return Bake(CornellBox(), parameters, {}, {}, limit);
}

/// A limit between what the box takes before anything is divided and what `error` needs in constants.
std::size_t TooLittleFor(double error) {
  // Bytes beside the base, as counted for the targets that are asked for here.
  const double divided = 0.4e6 / error;
  try {
    BakeIn(1, Asking(error, 0));
  } catch (const OutOfMemory& failed) {
    const std::string text = failed.what();
    return static_cast<std::size_t>(1e6 * std::stod(text.substr(text.find("least ") + 6)) + 0.5 * divided);
  }
  return 0;
}

TEST(BakeMemory, CoarsensTheTargetWithAWarningWhereTheLimitIsPassed) {
  constexpr double kAsked = 0.05;
  const std::size_t limit = TooLittleFor(kAsked);
  const Statistics free = BakeIn(kPlenty, Asking(kAsked, 0)).statistics;
  EXPECT_EQ(free.stopped_by, StoppedBy::kError);
  EXPECT_EQ(free.memory_limit, kPlenty);
  EXPECT_THAT(free.warnings, ::testing::IsEmpty());

  const Statistics bound = BakeIn(limit, Asking(kAsked, 512)).statistics;
  EXPECT_EQ(bound.stopped_by, StoppedBy::kLimit);
  EXPECT_EQ(bound.memory_limit, limit);
  EXPECT_EQ(bound.parameters.error, kAsked);
  EXPECT_LT(bound.iterations.back().links, free.iterations.back().links);
  ASSERT_EQ(bound.warnings.size(), 1U);
  EXPECT_THAT(
      bound.warnings.front(),
      ::testing::MatchesRegex("an error of 5 % would have needed about [0-9.]+ MB of memory; baked to "
                              "[0-9]+ % within the limit of [0-9.]+ MB"));
  const std::string& text = bound.warnings.front();
  const double coarsened = std::stod(text.substr(text.find("baked to ") + 9)) / 100;
  EXPECT_GT(coarsened, kAsked);
  ASSERT_TRUE(bound.measured.has_value());
  EXPECT_LE(bound.measured->error, coarsened) << "a good bake of what it was coarsened to";
  const double needed = std::stod(text.substr(text.find("about ") + 6));
  EXPECT_GT(1e6 * needed, static_cast<double>(limit));
}

TEST(BakeMemory, WithinALimitGivesTheSameBytesOnOneThreadAndOnTwo) {
  const std::size_t limit = TooLittleFor(0.1);
  std::string first;
  for (const std::size_t threads : {1U, 2U}) {
    const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
    const BakeResult result = BakeIn(limit, Asking(0.1, 0));
    EXPECT_EQ(result.statistics.stopped_by, StoppedBy::kLimit);
    if (first.empty()) {
      first = result.glb;
    }
    EXPECT_TRUE(result.glb == first) << threads << " threads";
  }
}

TEST(BakeMemory, IsWatchedWithinATimeBudgetToo) {
  Parameters parameters = Asking(0.05, 0);
  parameters.time_budget = 1e5;
  const Statistics statistics = BakeIn(TooLittleFor(0.05), parameters).statistics;
  EXPECT_EQ(statistics.stopped_by, StoppedBy::kLimit);
  EXPECT_THAT(statistics.warnings, ::testing::ElementsAre(::testing::HasSubstr("would have needed")));
}

TEST(BakeMemory, IsWatchedWithEachMethodAndWithoutTheFinalGather) {
  for (const Method method : {Method::kMatrix, Method::kTwoLevel, Method::kHierarchical, Method::kAdaptive}) {
    Parameters parameters = Asking(0.05, 0);
    parameters.method = method;
    parameters.final_gather = FinalGather::kOff;
    const Statistics statistics = BakeIn(TooLittleFor(0.05), parameters).statistics;
    EXPECT_EQ(statistics.stopped_by, StoppedBy::kLimit) << static_cast<int>(method);
  }
}

TEST(BakeMemory, ThatIsTooLittleForTheSceneIsAnErrorThatSaysWhatItTakes) {
  EXPECT_THAT([] { BakeIn(1'000'000, Asking(0.1, 0)); },
              ::testing::ThrowsMessage<OutOfMemory>(::testing::MatchesRegex(
                  "out of memory: the scene takes at least [0-9]+ MB however coarsely it is baked, and the "
                  "limit is 1\\.0 MB")));
}

}  // namespace
}  // namespace radbake
