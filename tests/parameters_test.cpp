#include "solver/parameters.h"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <string>

#include "solver/scene/types.h"

namespace radbake {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

/// The message that `json` is refused with; empty if it is taken.
std::string Refusal(std::string_view json) {
  try {
    ParseParameters(json);
  } catch (const InputError& error) {
    return error.what();
  }
  return {};
}

TEST(Parameters, TakeDefaultsForAnEmptyObject) {
  const Parameters parameters = ParseParameters("{}");
  EXPECT_EQ(parameters.error, 0.02);
  EXPECT_FALSE(parameters.time_budget);
  EXPECT_EQ(parameters.method, Method::kAdaptive);
  EXPECT_FALSE(parameters.basis);
  EXPECT_EQ(parameters.final_gather, FinalGather::kAuto);
  EXPECT_FALSE(parameters.exposure);
  EXPECT_TRUE((parameters.environment == 0).all());
  EXPECT_EQ(parameters.check, 256U);
}

TEST(Parameters, TakeEveryKeyThatIsBuilt) {
  const Parameters parameters = ParseParameters(R"({
    "error": 0.05, "time_budget": 30, "method": "hierarchical", "basis": "linear", "clustering": "off",
    "final_gather": "on", "output": {"kind": "vertex", "exposure": 2.5},
    "environment": {"radiance": [0, 0.5, 1e18]}, "oracle": {"a_min": 1e-4, "f_max": 0.1, "w_min": 1e-5}, "check": 0})");
  EXPECT_EQ(parameters.error, 0.05);
  EXPECT_EQ(parameters.time_budget, 30);
  EXPECT_EQ(parameters.method, Method::kHierarchical);
  EXPECT_EQ(parameters.basis, BasisOrder::kLinear);
  EXPECT_EQ(parameters.final_gather, FinalGather::kOn);
  EXPECT_EQ(parameters.exposure, 2.5);
  EXPECT_TRUE((parameters.environment == Rgb(0, 0.5, 1e18)).all());
  EXPECT_EQ(parameters.oracle.a_min, 1e-4);
  EXPECT_EQ(parameters.oracle.f_max, 0.1);
  EXPECT_EQ(parameters.oracle.w_min, 1e-5);
  EXPECT_EQ(parameters.check, 0U);
}

TEST(Parameters, TakeBackWhatTheyWrite) {
  for (
      const std::string_view json :
      {R"({})",
       R"({"error": 0.125, "time_budget": 3, "method": "hierarchical", "basis": "quadratic", "final_gather": "on", "check": 7,
            "output": {"exposure": 0.5}, "environment": {"radiance": [1, 0.25, 0]}, "oracle": {"a_min": 0.001, "f_max": 0.25, "w_min": 0.5}})"}) {
    const nlohmann::ordered_json written = ToJson(ParseParameters(json));
    EXPECT_EQ(ToJson(ParseParameters(written.dump())), written);
    EXPECT_EQ(written["output"]["kind"], "vertex");
  }
}

TEST(Parameters, NameTheKeyAndWhatItTakesWhenAValueIsNotTaken) {
  struct Case {
    const char* json;
    const char* key;
    const char* takes;
  };
  for (const Case& one : std::initializer_list<Case>{
           {R"({"error": 0.0009})", "error", "0.001 to 0.5"},
           {R"({"error": 0.51})", "error", "0.001 to 0.5"},
           {R"({"error": "0.02"})", "error", "0.001 to 0.5"},
           {R"({"error": null})", "error", "0.001 to 0.5"},
           {R"({"error": [0.02]})", "error", "0.001 to 0.5"},
           {R"({"time_budget": 0})", "time_budget", "seconds above 0"},
           {R"({"time_budget": -1})", "time_budget", "seconds above 0"},
           {R"({"time_budget": 1000001})", "time_budget", "seconds above 0"},
           {R"({"time_budget": true})", "time_budget", "seconds above 0"},
           {R"({"method": "best"})", "method", "matrix, two-level, hierarchical or adaptive"},
           {R"({"method": 1})", "method", "matrix, two-level, hierarchical or adaptive"},
           {R"({"basis": "cubic"})", "basis", "takes auto, constant, linear or quadratic"},
           {R"({"basis": 1})", "basis", "takes auto, constant, linear or quadratic"},
           {R"({"clustering": "sometimes"})", "clustering", "auto, on or off"},
           {R"({"final_gather": true})", "final_gather", "auto, on or off"},
           {R"({"output": {"kind": "lightmap"}})", "output.kind", "takes vertex"},
           {R"({"output": {"exposure": 0}})", "output.exposure", "auto or a number above 0"},
           {R"({"output": {"exposure": "bright"}})", "output.exposure", "auto or a number above 0"},
           {R"({"output": {"texel_size": 0.1}})", "output.texel_size", "lightmap and texture output"},
           {R"({"output": {"max_size": 1024}})", "output.max_size", "lightmap and texture output"},
           {R"({"output": "vertex"})", "output", "takes an object"},
           {R"({"environment": {"radiance": [1, 1]}})", "environment.radiance", "[red, green, blue]"},
           {R"({"environment": {"radiance": [1, 1, -1]}})", "environment.radiance", "from 0 to 1e18"},
           {R"({"environment": {"radiance": [1, 1, 1e19]}})", "environment.radiance", "from 0 to 1e18"},
           {R"({"environment": {"radiance": [1, "1", 1]}})", "environment.radiance", "each a number"},
           {R"({"environment": [1, 1, 1]})", "environment", "an object"},
           {R"({"environment": {"radiance": 0}})", "environment.radiance", "[red, green, blue]"},
           {R"({"oracle": {"a_min": 0}})", "oracle.a_min", "above 0 and below 1"},
           {R"({"oracle": {"f_max": 1}})", "oracle.f_max", "above 0 and below 1"},
           {R"({"oracle": {"w_min": -0.5}})", "oracle.w_min", "above 0 and below 1"},
           {R"({"check": -1})", "check", "an integer from 0 to 1,000,000"},
           {R"({"check": 1000001})", "check", "an integer from 0 to 1,000,000"},
           {R"({"check": 1.5})", "check", "an integer from 0 to 1,000,000"},
       }) {
    EXPECT_THAT(Refusal(one.json),
                AllOf(HasSubstr(std::string(one.key) + " takes"), HasSubstr(one.takes), Not(HasSubstr("\n"))))
        << one.json;
  }
}

TEST(Parameters, TakeTheEndsOfTheirRanges) {
  for (const char* json :
       {R"({"error": 0.001})", R"({"error": 0.5})", R"({"time_budget": 1e6})", R"({"check": 1000000})",
        R"({"time_budget": null})", R"({"oracle": {"a_min": null}})"}) {
    EXPECT_EQ(Refusal(json), "") << json;
  }
}

TEST(Parameters, RefuseAnUnknownKeyByName) {
  EXPECT_THAT(Refusal(R"({"eror": 0.02})"), AllOf(HasSubstr("\"eror\""), HasSubstr("time_budget")));
  EXPECT_THAT(Refusal(R"({"output": {"colour": 1}})"), HasSubstr("\"output.colour\""));
  EXPECT_THAT(Refusal(R"({"output.kind": "vertex"})"), HasSubstr("\"output.kind\""));
  EXPECT_THAT(Refusal(R"({"": 1})"), HasSubstr("\"\""));
  EXPECT_THAT(Refusal(R"({"error": {"error": 0.1}})"), HasSubstr("error takes"));
}

TEST(Parameters, RefuseADuplicateKeyAtAnyDepth) {
  EXPECT_THAT(Refusal(R"({"error": 0.1, "error": 0.2})"), HasSubstr("\"error\" is there twice"));
  EXPECT_THAT(Refusal(R"({"oracle": {"a_min": 0.1, "a_min": 0.1}})"), HasSubstr("\"a_min\" is there twice"));
}

TEST(Parameters, RefuseTextThatIsNotAJsonObject) {
  for (const char* json : {"", "{", "{\"error\": NaN}", "{\"error\": Infinity}", "{}{}", "{\"error\": 0.1,}",
                           "{\"\xff\": 1}", "/* */{}"}) {
    EXPECT_THAT(Refusal(json), AllOf(HasSubstr("not JSON at line 1"), Not(HasSubstr("\xff")))) << json;
  }
  EXPECT_THAT(Refusal("[]"), HasSubstr("takes a JSON object"));
  EXPECT_THAT(Refusal("0.02"), HasSubstr("takes a JSON object"));
  EXPECT_THAT(Refusal("{\"time_budget\": 1e999}"), HasSubstr("out of range"));
}

TEST(Parameters, RefuseDeepNestingAndLongText) {
  EXPECT_THAT(Refusal("{\"error\": " + std::string(30000, '[')), HasSubstr("nested deeper than 8"));
  std::string objects;
  for (int i = 0; i < 9; ++i) {
    objects += "{\"a\":";
  }
  EXPECT_THAT(Refusal(objects), HasSubstr("nested deeper than 8"));
  EXPECT_THAT(Refusal("{}" + std::string(70000, ' ')), HasSubstr("longer than 64 KiB"));
}

TEST(Parameters, KeepTheMessageOneShortLineWhateverTheInput) {
  const std::string message = Refusal("{\"a\\nb" + std::string(5000, 'x') + "\": 1}");
  EXPECT_THAT(message, AllOf(HasSubstr("unknown key \"a\\nb"), Not(HasSubstr("\n"))));
  EXPECT_LT(message.size(), 500U);
  EXPECT_LT(Refusal("{\"method\": \"" + std::string(5000, 'x') + "\"}").size(), 500U);
}

TEST(Parameters, AreSetFromTheTextOfAFlag) {
  Parameters parameters;
  SetParameter("method", "hierarchical", parameters);
  SetParameter("error", "0.1", parameters);
  SetParameter("output.exposure", "3", parameters);
  SetParameter("check", "12", parameters);
  SetParameter("environment.radiance", "[3, 2, 1]", parameters);
  EXPECT_EQ(parameters.method, Method::kHierarchical);
  EXPECT_EQ(parameters.error, 0.1);
  EXPECT_EQ(parameters.exposure, 3);
  EXPECT_EQ(parameters.check, 12U);
  EXPECT_TRUE((parameters.environment == Rgb(3, 2, 1)).all());
  SetParameter("output.exposure", "auto", parameters);
  EXPECT_FALSE(parameters.exposure);
  EXPECT_THROW(SetParameter("error", "much", parameters), InputError);
  EXPECT_THROW(SetParameter("error", "", parameters), InputError);
  EXPECT_THROW(SetParameter("method", "\xff", parameters), InputError);
  EXPECT_THROW(SetParameter("output", "{}", parameters), InputError);
  EXPECT_EQ(parameters.error, 0.1);
}

}  // namespace
}  // namespace radbake
