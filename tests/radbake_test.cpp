/// The whole bake, from bytes to bytes.
#include "solver/radbake.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <oneapi/tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/gltf/builder_test.h"

namespace radbake {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::StartsWith;

gltf::Source Ours(const std::string& name) {
  return gltf::ReadSource(std::string(RADBAKE_SOURCE_DIR "/scenes/") + name);
}

gltf::Source Shared(const std::string& name) {
  return gltf::ReadSource(std::string(RADBAKE_SOURCE_DIR "/../shared/scenes/") + name);
}

Parameters Asking(double error, std::size_t probes) {
  Parameters parameters;
  parameters.error = error;
  parameters.check = probes;
  return parameters;
}

TEST(Bake, GivesTheSameBytesOnOneThreadAndOnTwoAndAgain) {
  const Parameters parameters = Asking(0.1, 0);
  std::string first;
  for (const std::size_t threads : {1U, 2U, 2U}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    const std::string glb = Bake(Ours("cornell-box.glb"), parameters).glb;
    if (first.empty()) {
      first = glb;
    }
    EXPECT_TRUE(glb == first) << threads << " threads";
  }
}

// The suite whose name begins with Accuracy measures; it takes too long under a sanitizer.
TEST(Accuracy, OfTheDefaultBakeOfTheCornellBoxIsTwoPercentWithoutBias) {
  const Statistics statistics = Bake(Ours("cornell-box.glb"), Asking(0.02, 4096)).statistics;
  ASSERT_TRUE(statistics.measured.has_value());
  EXPECT_LE(statistics.measured->error, 0.02);
  EXPECT_LE(std::abs(statistics.measured->bias), 0.005);
  EXPECT_EQ(statistics.measured->missing, 0);
  EXPECT_LE(statistics.energy.imbalance, 0.005);
  EXPECT_EQ(statistics.stopped_by, StoppedBy::kError);
}

TEST(Accuracy, OfTheDefaultBakeOfTwoRoomsIsThreePercent) {
  const Statistics statistics = Bake(Ours("two-rooms.glb"), Asking(0.02, 2048)).statistics;
  ASSERT_TRUE(statistics.measured.has_value());
  EXPECT_LE(statistics.measured->error, 0.03);
  EXPECT_LE(statistics.energy.imbalance, 0.005);
}

TEST(Accuracy, OfALampCloseUnderTheCeilingIsTwoPercentToo) {
  // Most of ‖E‖ lies between the two, in a gap of a six-hundredth of the room.
  const Statistics statistics = Bake(Shared("cornell-box-bevy.glb"), Asking(0.02, 4096)).statistics;
  ASSERT_TRUE(statistics.measured.has_value());
  EXPECT_LE(statistics.measured->error, 0.02);
  EXPECT_LE(statistics.energy.imbalance, 0.005);
}

TEST(Accuracy, OfTheBalanceIsAHalfPercentEvenCoarselyWhereTheBrightPartOfACeilingIsHidden) {
  for (const BasisOrder basis : {BasisOrder::kLinear, BasisOrder::kQuadratic}) {
    for (const double error : {0.1, 0.05}) {
      Parameters parameters = Asking(error, 0);
      parameters.basis = basis;
      const Statistics statistics = Bake(Shared("cornell-box-bevy.glb"), parameters).statistics;
      EXPECT_LE(statistics.energy.imbalance, 0.005) << static_cast<int>(basis) << " " << error;
    }
  }
}

TEST(Accuracy, RisesEachTimeThatTheErrorIsHalved) {
  double last = 1;
  for (const double error : {0.08, 0.04, 0.02, 0.01}) {
    const Statistics statistics = Bake(Ours("cornell-box.glb"), Asking(error, 2048)).statistics;
    ASSERT_TRUE(statistics.measured.has_value());
    EXPECT_LT(statistics.measured->error, last) << "asked for " << error;
    last = statistics.measured->error;
  }
}

TEST(Accuracy, OfTheOtherScenesIsTwoPercentToo) {
  for (const char* name :
       {"furnace-box.glb", "furnace-sphere.glb", "plates-parallel.glb", "plates-perpendicular.glb",
        "plates-occluded.glb", "three-lights.glb", "tube.glb"}) {
    const Statistics statistics = Bake(Ours(name), Asking(0.02, 1024)).statistics;
    ASSERT_TRUE(statistics.measured.has_value());
    EXPECT_LE(statistics.measured->error, 0.02) << name;
    EXPECT_LE(statistics.energy.imbalance, 0.005) << name;
  }
}

gltf::Source FurnishedRoom() {
  std::string folder = (std::filesystem::temp_directory_path() / "radbake-furnished-XXXXXX").string();
  if (mkdtemp(folder.data()) == nullptr) {
    throw std::runtime_error("no temporary folder");
  }
  const std::string file = folder + "/room.glb";
  const std::string command =
      "python3 -B '" RADBAKE_SOURCE_DIR "/scenes/make_room.py' 10000 '" + file + "' > /dev/null";
  EXPECT_EQ(std::system(command.c_str()), 0);  // NOLINT(concurrency-mt-unsafe)
  gltf::Source room = gltf::ReadSource(file);
  std::filesystem::remove_all(folder);
  return room;
}

TEST(Accuracy, OfAFurnishedRoomOfManySmallPatchesIsWhatIsAsked) {
  const gltf::Source room = FurnishedRoom();
  // Of 512 probes the bias is uncertain by ±1.3 %.
  const Statistics statistics = Bake(room, Asking(0.2, 4096)).statistics;
  EXPECT_EQ(statistics.scene.triangles, 9980U);
  ASSERT_TRUE(statistics.measured.has_value());
  EXPECT_LE(statistics.measured->error, 0.2);
  EXPECT_LE(std::abs(statistics.measured->bias), 0.03);
  EXPECT_LE(statistics.energy.imbalance, 0.02);
  // Far from one for each pair, or for each pair of objects.
  EXPECT_LE(statistics.iterations.back().links, 60'000U);
  EXPECT_EQ(statistics.stopped_by, StoppedBy::kError);
}

TEST(Accuracy, OfAFurnishedRoomIsNotWhatItsClustersSmear) {
  // As the solution has it, what surfaces reflect is 4 % too dark where they are lit and far too bright under
  // the furniture, and the bake 2 % too dark.
  const Statistics statistics = Bake(FurnishedRoom(), Asking(0.05, 8192)).statistics;
  ASSERT_TRUE(statistics.measured.has_value());
  EXPECT_LE(statistics.measured->error, 0.05);
  EXPECT_LE(std::abs(statistics.measured->bias), 0.014);
}

TEST(Bake, WarnsOfAnEnergyBalanceThatIsOpen) {
  Parameters parameters = Asking(0.1, 0);
  EXPECT_THAT(Bake(Ours("cornell-box.glb"), parameters).statistics.warnings, IsEmpty());
  // Of a tube two hundred times as long as it is wide few elements know the whole.
  parameters.method = Method::kHierarchical;
  parameters.oracle.f_max = 0.5;
  parameters.oracle.a_min = 0.01;
  const Statistics statistics = Bake(Ours("tube.glb"), parameters).statistics;
  EXPECT_GT(statistics.energy.imbalance, 0.02);
  EXPECT_THAT(statistics.warnings, ElementsAre(StartsWith("the energy balance is open by ")));
}

TEST(Accuracy, WithoutFinalGatherIsThatOfTheSolution) {
  Parameters parameters = Asking(0.02, 1024);
  const Statistics gathered = Bake(Ours("cornell-box.glb"), parameters).statistics;
  parameters.final_gather = FinalGather::kOff;
  const Statistics solution = Bake(Ours("cornell-box.glb"), parameters).statistics;
  EXPECT_EQ(solution.iterations.back().links, gathered.iterations.back().links);
  EXPECT_LT(solution.rays, gathered.rays);
  ASSERT_TRUE(solution.measured && gathered.measured);
  EXPECT_LT(solution.measured->error, 0.04);
  // What is above the target has not reached it.
  EXPECT_GT(solution.estimated_error, 0.02);
  EXPECT_EQ(solution.stopped_by, StoppedBy::kLimit);
  EXPECT_LT(std::abs(solution.measured->bias), 0.005);
  EXPECT_LT(gathered.measured->error, 0.6 * solution.measured->error);
}

TEST(Bake, NamesWhatItDoesNotUse) {
  const BakeResult result = Bake(Shared("cornell-box-bevy.glb"), Asking(0.2, 0));
  EXPECT_EQ(result.statistics.scene.triangles, 36U);
  bool second_set = false;
  for (const Ignored& ignored : result.statistics.scene.ignored) {
    second_set = second_set || ignored.feature.find("TEXCOORD_1") != std::string::npos;
  }
  EXPECT_TRUE(second_set);
}

TEST(Bake, SaysThatNothingEmits) {
  EXPECT_THAT([] { Bake({gltf::OneTriangle().Glb(), {}}, Parameters()); },
              ::testing::ThrowsMessage<InputError>(::testing::HasSubstr("nothing in the scene emits light")));
}

TEST(Bake, ReportsProgressThatNeverFallsAndStopsWhenTold) {
  double last = 0;
  std::size_t reports = 0;
  Bake(Ours("cornell-box.glb"), Asking(0.1, 0), [&](const Progress& progress) {
    EXPECT_GE(progress.fraction, last);
    EXPECT_LE(progress.fraction, 1);
    last = progress.fraction;
    ++reports;
    return Continue::kYes;
  });
  EXPECT_GE(reports, 4U);
  EXPECT_EQ(last, 1);
  EXPECT_THROW(Bake(Ours("cornell-box.glb"), Asking(0.1, 0),
                    [](const Progress& progress) {
                      return progress.phase == "gather" ? Continue::kStop : Continue::kYes;
                    }),
               Interrupted);
}

TEST(Bake, SaysWhatShareOfEachPhaseItsRaysTake) {
  const Statistics statistics = Bake(Ours("cornell-box.glb"), Asking(0.1, 0)).statistics;
  std::vector<std::string> phases;
  std::vector<double> shares;
  for (const auto& [phase, share] : statistics.ray_shares) {
    phases.push_back(phase);
    shares.push_back(share);
    EXPECT_GT(share, 0) << phase;
    EXPECT_LT(share, 1) << phase;
  }
  EXPECT_THAT(phases, ::testing::ElementsAre("solve", "energy", "gather", "all"));
  // The whole lies between its parts.
  EXPECT_LE(shares.back(), *std::max_element(shares.begin(), shares.end() - 1));
  EXPECT_GE(shares.back(), *std::min_element(shares.begin(), shares.end() - 1));
}

TEST(Bake, StopsRefiningWhenTimeIsUp) {
  Parameters parameters = Asking(0.001, 0);
  parameters.time_budget = 0.05;
  const BakeResult result = Bake(Ours("cornell-box.glb"), parameters);
  EXPECT_EQ(result.statistics.stopped_by, StoppedBy::kTimeBudget);
  std::size_t lit = 0;
  const std::vector<Rgb> irradiance = gltf::ReadIrradiance({result.glb, {}}).irradiance;
  for (const Rgb& e : irradiance) {
    lit += Luminance(e) > 0 ? 1U : 0U;
  }
  EXPECT_GT(2 * lit, irradiance.size()) << "what was not gathered has the solution's light";
}

TEST(Bake, WithTimeEnoughEndsByItsError) {
  constexpr double kError = 0.2;
  Parameters parameters = Asking(kError, 0);
  parameters.time_budget = 1e5;
  const Statistics statistics = Bake(Ours("cornell-box.glb"), parameters).statistics;
  EXPECT_EQ(statistics.stopped_by, StoppedBy::kError);
  EXPECT_LE(statistics.estimated_error, kError);
  EXPECT_EQ(statistics.output.vertices,
            Bake(Ours("cornell-box.glb"), Asking(kError, 0)).statistics.output.vertices);
}

}  // namespace
}  // namespace radbake
