#include "solver/statistics.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace radbake {
namespace {

std::vector<std::string> Keys(const nlohmann::ordered_json& object) {
  std::vector<std::string> keys;
  for (const auto& [key, value] : object.items()) {
    keys.push_back(key);
  }
  return keys;
}

TEST(Statistics, WriteEveryPartOfTheContractInItsOrder) {
  using Names = std::vector<std::string>;
  Statistics statistics;
  statistics.measured.emplace();
  statistics.iterations.emplace_back();
  const nlohmann::ordered_json json = ToJson(statistics);
  EXPECT_EQ(Keys(json), (Names{"version", "parameters", "scene", "iterations", "energy", "error", "time",
                               "memory", "rays", "output", "stopped_by", "warnings"}));
  EXPECT_EQ(Keys(json["scene"]), (Names{"triangles", "patches", "materials", "lights", "ignored"}));
  EXPECT_EQ(Keys(json["iterations"][0]),
            (Names{"pass", "sweeps", "residual", "elements", "links", "factors", "rays", "seconds"}));
  EXPECT_EQ(Keys(json["memory"]),
            (Names{"limit_bytes", "peak_bytes", "bytes_per_element", "bytes_per_link"}));
  EXPECT_EQ(Keys(json["energy"]),
            (Names{"emitted", "absorbed", "absorbed_by_backs", "escaped", "imbalance"}));
  EXPECT_EQ(Keys(json["error"]["measured"]), (Names{"relative_rms", "low", "high", "bias", "bias_interval",
                                                    "missing", "probes", "rays", "noise"}));
}

TEST(Statistics, WriteTheValuesWhereTheyBelong) {
  Statistics statistics;
  statistics.parameters.error = 0.25;
  statistics.scene.patches = 17;
  statistics.scene.ignored = {{"punctual light 'lamp'", "not built yet"}};
  statistics.iterations = {{.pass = 1, .sweeps = 2, .residual = 0.5, .elements = 3, .links = 4, .rays = 5}};
  statistics.energy.emitted = {1, 2, 3};
  statistics.energy.imbalance = 0.125;
  statistics.estimated_error = 0.0625;
  statistics.measured.emplace();
  statistics.measured->error = 0.03125;
  statistics.measured->error_low = 0.03;
  statistics.seconds = {{"solve", 1.5}, {"import", 0.25}};
  statistics.memory_limit = 5000;
  statistics.peak_bytes = 1000;
  statistics.solve_bytes = {.elements = 300, .links = 1000};
  statistics.rays = 99;
  statistics.ray_seconds = 0.75;
  statistics.ray_shares = {{"solve", 0.25}, {"gather", 0.5}};
  statistics.output.vertices = 11;
  statistics.stopped_by = StoppedBy::kTimeBudget;
  statistics.warnings = {"careful"};
  const nlohmann::ordered_json json = ToJson(statistics);
  EXPECT_EQ(json["parameters"]["error"], 0.25);
  EXPECT_EQ(json["scene"]["patches"], 17);
  EXPECT_EQ(json["scene"]["ignored"][0]["feature"], "punctual light 'lamp'");
  EXPECT_EQ(json["scene"]["ignored"][0]["reason"], "not built yet");
  EXPECT_EQ(json["iterations"][0]["links"], 4);
  EXPECT_EQ(json["energy"]["emitted"], (std::vector{1.0, 2.0, 3.0}));
  EXPECT_EQ(json["energy"]["imbalance"], 0.125);
  EXPECT_EQ(json["error"]["estimated"], 0.0625);
  EXPECT_EQ(json["error"]["measured"]["relative_rms"], 0.03125);
  EXPECT_EQ(json["error"]["measured"]["low"], 0.03);
  EXPECT_EQ(json["time"].dump(), R"({"solve":1.5,"import":0.25,"total":1.75})");
  EXPECT_EQ(json["memory"].dump(),
            R"({"limit_bytes":5000,"peak_bytes":1000,"bytes_per_element":100.0,"bytes_per_link":250.0})");
  EXPECT_EQ(json["rays"].dump(), R"({"count":99,"seconds":0.75,"share":{"solve":0.25,"gather":0.5}})");
  EXPECT_EQ(json["output"]["vertices"], 11);
  EXPECT_EQ(json["stopped_by"], "time_budget");
  EXPECT_EQ(json["warnings"][0], "careful");
}

TEST(Statistics, SayNullWhereNothingWasMeasured) {
  const nlohmann::ordered_json json = ToJson(Statistics{});
  EXPECT_TRUE(json["error"]["measured"].is_null());
  EXPECT_TRUE(json["scene"]["ignored"].is_array());
  EXPECT_TRUE(json["iterations"].is_array());
}

}  // namespace
}  // namespace radbake
