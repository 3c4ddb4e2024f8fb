#include <fcntl.h>
#include <gmock/gmock.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <sstream>

#include "solver/parameters.h"
#include "tests/cli/run_radbake.h"

namespace radbake {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::IsOneLine;
using testing::Outcome;
using testing::ReadFile;
using testing::SceneFile;
using ::testing::StartsWith;

class BakeCommand : public testing::RadbakeTest {
 protected:
  /// A bake of a small scene in moments.
  Outcome Bake(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), {"bake", SceneFile("furnace-box.glb"), "-o", File("baked.glb"),
                                         "--error", "0.1", "--check", "0"});
    return Radbake(arguments);
  }
};

std::vector<json> Lines(const std::string& text) {
  std::vector<json> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) {
    lines.push_back(json::parse(line));
  }
  return lines;
}

TEST_F(BakeCommand, PrintsItsVersionAndHelp) {
  const Outcome version = Radbake({"--version"});
  EXPECT_EQ(version.code, 0);
  EXPECT_THAT(version.out, StartsWith("radbake "));
  const Outcome help = Radbake({"bake", "--help"});
  EXPECT_EQ(help.code, 0);
  EXPECT_THAT(help.out,
              AllOf(HasSubstr("--time-budget"), HasSubstr("--oracle.a-min"), HasSubstr("--statistics")));
}

TEST_F(BakeCommand, WritesAGlbAndSaysSoInOneLine) {
  const Outcome run = Bake({});
  EXPECT_EQ(run.code, 0) << run.error;
  EXPECT_THAT(run.out, AllOf(StartsWith(File("baked.glb")), HasSubstr("error"), HasSubstr("vertices")));
  EXPECT_TRUE(IsOneLine(run.out));
  EXPECT_EQ(run.error, "");
  EXPECT_THAT(ReadFile(File("baked.glb")), StartsWith("glTF"));
  EXPECT_THAT(Names(), ElementsAre("baked.glb"));
}

TEST_F(BakeCommand, LetsAFlagWinOverTheParametersFile) {
  Write("p.json", R"({"error": 0.3, "method": "hierarchical", "oracle": {"f_max": 0.25}, "check": 0})");
  const Outcome run = Radbake({"bake", SceneFile("furnace-box.glb"), "-o", File("baked.glb"), "--parameters",
                               File("p.json"), "--error", "0.25", "--statistics", File("s.json")});
  ASSERT_EQ(run.code, 0) << run.error;
  const json statistics = json::parse(ReadFile(File("s.json")));
  EXPECT_EQ(statistics["parameters"]["error"], 0.25);
  EXPECT_EQ(statistics["parameters"]["method"], "hierarchical");
  EXPECT_EQ(statistics["parameters"]["oracle"]["f_max"], 0.25);
  EXPECT_THAT(Names(), ElementsAre("baked.glb", "p.json", "s.json"));
}

TEST_F(BakeCommand, TakesEveryParameterAsAFlagOfTheSameName) {
  std::vector<std::string> arguments = {"bake", SceneFile("furnace-box.glb"), "-o", File("baked.glb")};
  for (const ParameterSpec& spec : ParameterSpecs()) {
    const json value = spec.write(ParseParameters(R"({"error": 0.1, "check": 0})"));
    if (!value.is_null()) {
      arguments.push_back("--" + std::string(spec.key));
      arguments.push_back(value.is_string() ? value.get<std::string>() : value.dump());
    }
  }
  ASSERT_GT(arguments.size(), 16U);
  const Outcome run = Radbake(arguments);
  EXPECT_EQ(run.code, 0) << run.error;
}

TEST_F(BakeCommand, RefusesBadUsageInOneLineWithExitCodeTwo) {
  Write("bad.json", "{\"error\": }");
  Write("unknown.json", "{\"eror\": 0.1}");
  const std::string scene = SceneFile("furnace-box.glb");
  const std::string baked = File("baked.glb");
  struct Case {
    std::vector<std::string> arguments;
    const char* named;
  };
  for (const Case& one : std::initializer_list<Case>{
           {{}, "subcommand"},
           {{"bake"}, "SCENE"},
           {{"bake", scene}, "-o"},
           {{"bake", scene, "-o", baked, "--oops", "1"}, "--oops"},
           {{"bake", scene, "-o", baked, "another.glb"}, "another.glb"},
           {{"bake", scene, "-o", baked, "--error", "0.9"},
            "error takes a number from 0.001 to 0.5, not 0.9"},
           {{"bake", scene, "-o", baked, "--error", "-1"}, "error takes"},
           {{"bake", scene, "-o", baked, "--method", "best"}, "method takes matrix, two-level"},
           {{"bake", scene, "-o", baked, "--output", "lightmap"}, "output.kind takes vertex"},
           {{"bake", scene, "-o", baked, "--threads", "0"}, "--threads"},
           {{"bake", scene, "-o", baked, "--progress", "loud"}, "--progress"},
           {{"bake", scene, "-o", baked, "--memory-limit", "much"}, "--memory-limit"},
           {{"bake", scene, "-o", baked, "--memory-limit", "-1"}, "--memory-limit"},
           {{"bake", scene, "-o", baked, "--parameters", File("bad.json")}, "bad.json"},
           {{"bake", scene, "-o", baked, "--parameters", File("unknown.json")}, "\"eror\""},
           {{"bake", scene, "-o", baked, "--parameters", File("none.json")}, "none.json"},
           {{"bake", scene, "-o", baked, "--statistics", baked}, "--statistics"},
           {{"bake", scene, "-o", scene}, "-o"},
           {{"bake", File("none.glb"), "-o", baked}, "none.glb"},
       }) {
    const Outcome run = Radbake(one.arguments);
    EXPECT_EQ(run.code, 2) << one.named << run.out;
    EXPECT_TRUE(IsOneLine(run.error)) << run.error;
    EXPECT_THAT(run.error, AllOf(StartsWith("radbake: "), HasSubstr(one.named)));
    EXPECT_EQ(run.out, "");
  }
  EXPECT_THAT(Names(), ElementsAre("bad.json", "unknown.json"));
}

TEST_F(BakeCommand, RefusesWhatIsNotAScene) {
  const std::string whole = ReadFile(SceneFile("furnace-box.glb"));
  Write("text.glb", "not a scene\n");
  Write("empty.glb", "");
  Write("short.glb", whole.substr(0, whole.size() / 2));
  Write("baked.glb", "an older result");
  const std::vector<std::string> before = Names();
  for (const char* name : {"text.glb", "empty.glb", "short.glb"}) {
    const Outcome run =
        Radbake({"bake", File(name), "-o", File("baked.glb"), "--statistics", File("s.json")});
    EXPECT_EQ(run.code, 2) << name;
    EXPECT_TRUE(IsOneLine(run.error)) << run.error;
    EXPECT_THAT(run.error, StartsWith("radbake: "));
  }
  EXPECT_EQ(Names(), before);
  EXPECT_EQ(ReadFile(File("baked.glb")), "an older result");
}

TEST_F(BakeCommand, FailsWithExitCodeOneWhereItCannotWrite) {
  for (const std::string& output : {File("no/such/folder.glb"), std::string("/dev/null"), File("")}) {
    const Outcome run = Radbake({"bake", SceneFile("furnace-box.glb"), "-o", output});
    EXPECT_EQ(run.code, 1) << output;
    EXPECT_THAT(run.error, StartsWith("radbake: cannot write " + output));
    EXPECT_TRUE(IsOneLine(run.error));
  }
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/null"));
  EXPECT_THAT(Names(), IsEmpty());
}

TEST_F(BakeCommand, ReplacesAnOlderFileAndFollowsALink) {
  Write("target.glb", "an older result");
  std::filesystem::create_symlink("target.glb", File("baked.glb"));
  EXPECT_EQ(Bake({}).code, 0);
  EXPECT_TRUE(std::filesystem::is_symlink(File("baked.glb")));
  EXPECT_THAT(ReadFile(File("target.glb")), StartsWith("glTF"));
  EXPECT_THAT(Names(), ElementsAre("baked.glb", "target.glb"));
}

TEST_F(BakeCommand, TakesAMemoryLimitInBytesOrLargerUnits) {
  for (const char* text : {"3000000000", "3000MB", "3GB"}) {
    const Outcome run = Bake({"--memory-limit", text, "--statistics", File("s.json")});
    ASSERT_EQ(run.code, 0) << run.error;
    EXPECT_EQ(json::parse(ReadFile(File("s.json")))["memory"]["limit_bytes"], 3'000'000'000);
  }
}

#if !defined(RADBAKE_ADDRESS_SANITIZER) && \
    !defined(RADBAKE_THREAD_SANITIZER)  // which take memory of their own
TEST_F(BakeCommand, StaysWithinItsMemoryLimitBakingCoarser) {
  // The peak counts the program's own files too, as many of their pages as the kernel maps at once: a few
  // megabytes more where they have just been written.
  for (const char* limit : {"30MB", "40MB", "45MB"}) {
    const Outcome run =
        Radbake({"bake", RADBAKE_SOURCE_DIR "/scenes/cornell-box.glb", "-o", File("baked.glb"), "--error",
                 "0.01", "--basis", "constant", "--memory-limit", limit, "--statistics", File("s.json")});
    ASSERT_EQ(run.code, 0) << run.error;
    EXPECT_THAT(run.error, HasSubstr(std::string("within the limit of ") + std::string(limit, 2) + " MB"));
    const json statistics = json::parse(ReadFile(File("s.json")));
    EXPECT_EQ(statistics["stopped_by"], "limit");
    EXPECT_LE(statistics["memory"]["peak_bytes"], statistics["memory"]["limit_bytes"]);
  }
}
#endif

TEST_F(BakeCommand, FailsWithExitCodeOneWhereTheSceneAloneTakesMoreMemory) {
  const Outcome run = Bake({"--memory-limit", "1MB"});
  EXPECT_EQ(run.code, 1);
  EXPECT_THAT(run.error,
              AllOf(StartsWith("radbake: out of memory: the scene takes at least "), HasSubstr("1.0 MB")));
  EXPECT_TRUE(IsOneLine(run.error));
  EXPECT_THAT(Names(), IsEmpty());
}

TEST_F(BakeCommand, PrintsEachWarningOnceOnALineOfItsOwn) {
  const Outcome run =
      Radbake({"bake", RADBAKE_SOURCE_DIR "/../shared/scenes/cornell-box-bevy.glb", "-o", File("baked.glb"),
               "--error", "0.3", "--check", "0", "--statistics", File("s.json")});
  ASSERT_EQ(run.code, 0) << run.error;
  const json statistics = json::parse(ReadFile(File("s.json")));
  ASSERT_FALSE(statistics["warnings"].empty());
  std::string expected;
  for (const json& warning : statistics["warnings"]) {
    expected += "radbake: warning: " + warning.get<std::string>() + "\n";
  }
  EXPECT_EQ(run.error, expected);
  for (const json& ignored : statistics["scene"]["ignored"]) {
    EXPECT_THAT(run.error, HasSubstr(ignored["feature"].get<std::string>()));
  }
}

TEST_F(BakeCommand, ReportsProgressAsOneJsonObjectALine) {
  const Outcome run = Bake({"--progress", "json"});
  ASSERT_EQ(run.code, 0) << run.error;
  const std::vector<json> lines = Lines(run.out);
  ASSERT_FALSE(lines.empty());
  double before = 0;
  for (const json& line : lines) {
    EXPECT_TRUE(line["phase"].is_string());
    EXPECT_TRUE(line["error"].is_number());
    EXPECT_TRUE(line["seconds"].is_number());
    EXPECT_TRUE(line["iteration"]["links"].is_number_unsigned());
    const double now = line["progress"];
    EXPECT_GE(now, before);
    EXPECT_LE(now, 1);
    before = now;
  }
}

TEST_F(BakeCommand, ShowsABarOnATerminal) {
  const int terminal = posix_openpt(O_RDWR | O_NOCTTY);
  ASSERT_GE(terminal, 0);
  ASSERT_EQ(grantpt(terminal), 0);
  ASSERT_EQ(unlockpt(terminal), 0);
  const int theirs = open(ptsname(terminal), O_RDWR | O_NOCTTY);  // NOLINT(concurrency-mt-unsafe)
  ASSERT_GE(theirs, 0);
  const pid_t process =
      Start({"bake", SceneFile("furnace-box.glb"), "-o", File("baked.glb"), "--check", "0"}, theirs);
  close(theirs);
  std::string shown;
  std::array<char, 4096> buffer{};
  for (ssize_t count = 0; (count = read(terminal, buffer.data(), buffer.size())) > 0;) {
    shown.append(buffer.data(), static_cast<std::size_t>(count));
  }
  close(terminal);
  EXPECT_EQ(Wait(process).code, 0);
  EXPECT_THAT(shown, AllOf(HasSubstr("["), HasSubstr(" %")));
  EXPECT_TRUE(shown.ends_with("\r\x1b[K")) << "the bar is cleared at the end";
}

TEST_F(BakeCommand, EndsAtOnceAndLeavesNothingWhenInterrupted) {
  for (const int signal : {SIGINT, SIGTERM}) {
    const pid_t process = Start({"bake", SceneFile("cornell-box.glb"), "-o", File("baked.glb"),
                                 "--statistics", File("s.json"), "--error", "0.001", "--progress", "json"});
    WaitForOutput(process);
    kill(process, signal);
    const Outcome run = Wait(process);
    EXPECT_EQ(run.code, 130);
    EXPECT_EQ(run.error, "radbake: interrupted\n");
    EXPECT_THAT(Names(), IsEmpty());
  }
}

TEST_F(BakeCommand, MakesTheSameBytesOnAnyNumberOfThreads) {
  std::vector<std::string> results;
  for (const char* threads : {"1", "2", "2"}) {
    const Outcome run = Radbake({"bake", SceneFile("cornell-box.glb"), "-o", File("baked.glb"), "--error",
                                 "0.1", "--check", "0", "--threads", threads});
    ASSERT_EQ(run.code, 0) << run.error;
    results.push_back(ReadFile(File("baked.glb")));
  }
  EXPECT_TRUE(results[0] == results[1]);
  EXPECT_TRUE(results[1] == results[2]);
}

TEST_F(BakeCommand, HoldsASceneToItsLimits) {
  const std::vector<std::pair<std::string, std::string>> limits = {
      {"--max-triangles", "triangles"},
      {"--max-nodes", "nodes"},
      {"--max-json-depth", "nested deeper than 1"}};
  for (const auto& [flag, named] : limits) {
    const Outcome outcome = Bake({flag, flag == "--max-json-depth" ? "1" : "0"});
    EXPECT_EQ(outcome.code, 2) << flag;
    EXPECT_THAT(outcome.error, HasSubstr(named));
  }
}

}  // namespace
}  // namespace radbake
