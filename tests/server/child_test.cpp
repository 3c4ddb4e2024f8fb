#include "server/child.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>

#include <csignal>

#include "tests/server/service_test.h"

namespace radbake::server {
namespace {

using ::testing::ElementsAre;

class ChildTest : public testing::Test {
 protected:
  ChildEnd Run(const std::string& script, const std::vector<std::string>& arguments = {}) {
    const std::filesystem::path program = WriteProgram(folder() / "program", script);
    return RunChild(
        {program, arguments, folder(), {}}, [&](std::string_view line) { lines_.emplace_back(line); }, stop_);
  }
  const std::filesystem::path& folder() const { return folder_.path(); }
  const std::vector<std::string>& lines() const { return lines_; }
  StopSignal& stop() { return stop_; }

 private:
  TemporaryFolder folder_;
  StopSignal stop_;
  std::vector<std::string> lines_;
};

TEST_F(ChildTest, TellsTheExitCodeAndTheLastErrorLine) {
  const ChildEnd end = Run("echo warning >&2; echo 'radbake: no triangles' >&2; exit 2");
  EXPECT_EQ(end.exit_code, 2);
  EXPECT_EQ(end.signal, 0);
  EXPECT_EQ(end.error, "radbake: no triangles");
}

TEST_F(ChildTest, TellsTheSignalThatKilledIt) {
  const ChildEnd end = Run("kill -SEGV $$");
  EXPECT_EQ(end.exit_code, -1);
  EXPECT_EQ(end.signal, SIGSEGV);
}

TEST_F(ChildTest, HandsOverWholeLinesAndTheLastOne) {
  Run(R"(printf 'one\ntw'; sleep 0.05; printf 'o\n\nthree')");
  EXPECT_THAT(lines(), ElementsAre("one", "two", "three"));
}

TEST_F(ChildTest, LeavesOutALineThatIsTooLong) {
  Run("head -c 70000 /dev/zero | tr '\\0' x; echo; echo short");
  EXPECT_THAT(lines(), ElementsAre("short"));
}

TEST_F(ChildTest, ReadsAllOfALongOutput) {
  EXPECT_EQ(Run("i=0; while [ $i -lt 20000 ]; do echo line $i; i=$((i+1)); done").exit_code, 0);
  ASSERT_EQ(lines().size(), 20000U);
  EXPECT_EQ(lines().back(), "line 19999");
}

TEST_F(ChildTest, RunsInItsFolderWithItsArguments) {
  Run(R"(pwd; printf '%s\n' "$@")", {"a b", "--c"});
  EXPECT_THAT(lines(), ElementsAre(folder().string(), "a b", "--c"));
}

TEST_F(ChildTest, InheritsNothingButItsThreeStreams) {
  const Descriptor leaky(::socket(AF_INET, SOCK_STREAM, 0));  // without SOCK_CLOEXEC, as a library may do
  const Descriptor high(::fcntl(leaky.get(), F_DUPFD, 100));
  ASSERT_TRUE(leaky.open() && high.open());
  std::vector<std::string> open;
  RunChild(
      {"/bin/ls", {"/proc/self/fd"}, folder(), {}}, [&](std::string_view line) { open.emplace_back(line); },
      stop());
  EXPECT_THAT(open, ElementsAre("0", "1", "2", "3"));  // 3: the folder that ls reads
}

TEST_F(ChildTest, HasNothingToRead) {
  EXPECT_EQ(Run("cat; echo end").exit_code, 0);
  EXPECT_THAT(lines(), ElementsAre("end"));
}

TEST_F(ChildTest, IsTerminatedWhenAskedToStop) {
  std::thread stopper([&] {
    EXPECT_TRUE(Eventually([&] { return std::filesystem::exists(folder() / "started"); }));
    stop().Raise();
  });
  const ChildEnd end = Run("touch started; exec sleep 1000");
  stopper.join();
  EXPECT_EQ(end.signal, SIGTERM);
}

TEST_F(ChildTest, IsKilledWhenItDoesNotListen) {
  std::thread stopper([&] {
    EXPECT_TRUE(Eventually([&] { return std::filesystem::exists(folder() / "started"); }));
    stop().Raise();
  });
  const ChildEnd end = Run("trap '' TERM; touch started; while true; do sleep 0.1; done");
  stopper.join();
  EXPECT_EQ(end.signal, SIGKILL);
}

TEST_F(ChildTest, EndsThoughADescendantHoldsItsPipes) {
  EXPECT_EQ(Run("sleep 20 & echo done; exit 3").exit_code, 3);
  EXPECT_THAT(lines(), ElementsAre("done"));
}

TEST_F(ChildTest, SaysSoWhenThereIsNoProgram) {
  const ChildEnd end = RunChild({folder() / "none", {}, folder(), {}}, [](std::string_view) {}, stop());
  EXPECT_EQ(end.exit_code, 127);
  EXPECT_NE(end.error, "");
}

}  // namespace
}  // namespace radbake::server
