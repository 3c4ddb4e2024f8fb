// What becomes of a job, by how its child ends.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/server/service_test.h"

namespace radbake::server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class BakeTest : public testing::Test {
 protected:
  // $test: the test's own folder.
  Service Start(const std::string& script, int workers = 1) const {
    const std::filesystem::path program = folder() / "radbake";
    return {data(), WriteProgram(program, "test=" + folder().string() + "\n" + script), workers};
  }
  const std::filesystem::path& folder() const { return folder_.path(); }
  std::filesystem::path data() const { return folder() / "data"; }
  std::filesystem::path Folder(const std::string& job) const {
    return data() / "jobs" / job.substr(job.rfind('/') + 1);
  }
  // How often the script has written a line to $test/runs.
  std::ptrdiff_t Runs() const {
    const std::string runs = ReadFile(folder() / "runs");
    return std::count(runs.begin(), runs.end(), '\n');
  }
  bool There(const std::string& name) const {
    return Eventually([&] { return std::filesystem::exists(folder() / name); });
  }

 private:
  TemporaryFolder folder_;
};

TEST_F(BakeTest, CallsRadbakeInAFolderOfTheAttempt) {
  const Service service = Start("printf '%s\\n' \"$PWD\" \"$@\" > $test/call\n" + kBakes);
  const std::string job = service.client().PostScene();
  service.client().WaitFor(job, "succeeded");
  EXPECT_EQ(ReadFile(folder() / "call"),
            (data() / "work" / (Folder(job).filename().string() + "-1")).string() +
                "\nbake\nupload/scene.glb\n-o\nattempt/baked.glb\n--parameters\nparameters.json\n" +
                "--statistics\nattempt/statistics.json\n--progress\njson\n--threads\n1\n");
  EXPECT_THAT(ListTree(Folder(job)),
              ElementsAre("baked.glb", "parameters.json", "statistics.json", "upload", "upload/scene.glb"));
  EXPECT_TRUE(Eventually([&] { return std::filesystem::is_empty(data() / "work"); }));
}

TEST_F(BakeTest, ShowsTheProgressWhileItRuns) {
  const Service service = Start(R"(
    echo '{"phase":"import","progress":0.1}'
    echo 'no progress'
    echo '{"phase":"solve","progress":0.42,"error":0.05,"seconds":0.31,"iteration":{"pass":2,"links":8000}}'
    while [ ! -e $test/go ]; do sleep 0.02; done)" +
                                kBakes);
  const Client client = service.client();
  const std::string job = client.PostScene();
  EXPECT_TRUE(Eventually([&] { return client.Get(job).Json().at("progress") == 0.42; }));
  const Answer answer = client.Get(job);
  const nlohmann::json running = answer.Json();
  EXPECT_EQ(running.at("status"), "running");
  EXPECT_EQ(running.at("phase"), "solve");
  EXPECT_EQ(running.at("statistics").at("error"), 0.05);
  EXPECT_EQ(running.at("statistics").at("iteration").at("links"), 8000);
  EXPECT_FALSE(running.at("started_at").is_null());
  EXPECT_EQ(answer.headers.at("retry-after"), "1");
  WriteFile(folder() / "go", "");
  EXPECT_EQ(client.WaitFor(job, "succeeded").at("progress"), 1);
}

TEST_F(BakeTest, FailsAtOnceWhenTheSceneIsBad) {
  const Service service = Start(
      "echo run >> $test/runs; echo '{\"progress\":0.25}'; echo 'radbake: node 3: a cycle' >&2; exit 2");
  const Client client = service.client();
  const std::string job = client.PostScene();
  const nlohmann::json failed = client.WaitFor(job, "failed");
  EXPECT_EQ(failed.at("error").at("detail"), "node 3: a cycle");
  EXPECT_EQ(failed.at("error").at("status"), 422);
  EXPECT_EQ(failed.at("error").at("type"), "urn:radbake:problem:scene");
  EXPECT_EQ(failed.at("progress"), 0.25);
  EXPECT_EQ(Runs(), 1);
  const Answer scene = client.Get(job + "/scene");
  EXPECT_EQ(scene.status, 409);
  EXPECT_THAT(scene.Json().at("detail").get<std::string>(), HasSubstr("node 3: a cycle"));
  EXPECT_FALSE(scene.headers.contains("retry-after"));
}

TEST_F(BakeTest, GivesUpAfterThreeAttempts) {
  const Service service = Start("echo run >> $test/runs; echo 'radbake: out of memory' >&2; exit 1");
  const nlohmann::json failed = service.client().WaitFor(service.client().PostScene(), "failed");
  EXPECT_EQ(Runs(), 3);
  EXPECT_EQ(failed.at("error").at("status"), 500);
  EXPECT_THAT(failed.at("error").at("detail").get<std::string>(), HasSubstr("out of memory"));
}

TEST_F(BakeTest, GivesUpWhenTheChildIsKilledThreeTimes) {
  const Service service = Start("echo run >> $test/runs; kill -KILL $$");
  const nlohmann::json failed = service.client().WaitFor(service.client().PostScene(), "failed");
  EXPECT_EQ(Runs(), 3);
  EXPECT_THAT(failed.at("error").at("detail").get<std::string>(), HasSubstr("signal 9"));
}

TEST_F(BakeTest, SucceedsWhenTheThirdAttemptDoes) {
  const Service service = Start(R"(
    echo run >> $test/runs
    touch attempt/left-behind
    [ $(wc -l < $test/runs) -lt 3 ] && kill -SEGV $$
    ls attempt > $test/seen)" + kBakes);
  service.client().WaitFor(service.client().PostScene(), "succeeded");
  EXPECT_EQ(Runs(), 3);
  EXPECT_EQ(ReadFile(folder() / "seen"), "left-behind\n") << "of this attempt";
}

TEST_F(BakeTest, FailsWhenTheChildSaysDoneAndLeavesNothing) {
  const Service service = Start("echo run >> $test/runs; exit 0");
  const nlohmann::json failed = service.client().WaitFor(service.client().PostScene(), "failed");
  EXPECT_EQ(Runs(), 3);
  EXPECT_THAT(failed.at("error").at("detail").get<std::string>(), HasSubstr("left no result"));
}

TEST_F(BakeTest, TakesForAResultOnlyFilesOfTheChildsOwn) {
  const Service service = Start(R"(
    echo run >> $test/runs
    if [ $(wc -l < $test/runs) -eq 1 ]; then mkfifo attempt/baked.glb; else ln -s $test/runs attempt/baked.glb; fi
    printf '{"version":"0"}' > attempt/statistics.json)");
  const nlohmann::json failed = service.client().WaitFor(service.client().PostScene(), "failed");
  EXPECT_EQ(Runs(), 3);
  EXPECT_THAT(failed.at("error").at("detail").get<std::string>(), HasSubstr("left no result"));
}

TEST_F(BakeTest, ShowsTheEndOfTheLogOfAJobThatFailed) {
  const Service service = Start(R"(
    i=0; while [ $i -lt 1000 ]; do echo line $i >&2; i=$((i + 1)); done; kill -KILL $$)");
  const nlohmann::json failed = service.client().WaitFor(service.client().PostScene(), "failed");
  const std::string log = failed.at("error").at("log").get<std::string>();
  EXPECT_THAT(log, testing::StartsWith("line "));
  EXPECT_THAT(log, testing::EndsWith("line 998\nline 999\n"));
  EXPECT_GT(log.size(), 3000U);
  EXPECT_LE(log.size(), 4000U);
}

TEST_F(BakeTest, RunsAsManyAtATimeAsThereAreWorkers) {
  const Service service =
      Start("touch $test/$$.run; while [ ! -e $test/go ]; do sleep 0.02; done" + kBakes, 2);
  const Client client = service.client();
  const std::vector<std::string> jobs = {client.PostScene(), client.PostScene(), client.PostScene()};
  client.WaitFor(jobs[0], "running");
  client.WaitFor(jobs[1], "running");
  EXPECT_EQ(client.Get(jobs[2]).Json().at("status"), "queued");
  WriteFile(folder() / "go", "");
  for (const std::string& job : jobs) {
    client.WaitFor(job, "succeeded");
  }
}

TEST_F(BakeTest, CancelsARunningJob) {
  const Service service = Start("echo '{\"progress\":0.5}'; echo run >> $test/runs; exec sleep 1000");
  const Client client = service.client();
  const std::string job = client.PostScene();
  EXPECT_TRUE(Eventually([&] { return client.Get(job).Json().at("progress") == 0.5; }));
  const Answer canceled = client.Request("POST", job + "/cancel");
  EXPECT_EQ(canceled.status, 200);
  EXPECT_EQ(canceled.Json().at("status"), "canceled");
  EXPECT_EQ(canceled.Json().at("progress"), 0.5);
  EXPECT_FALSE(canceled.headers.contains("retry-after"));
  EXPECT_EQ(client.Request("POST", job + "/cancel").status, 200) << "it is canceled, as asked";
  EXPECT_EQ(client.Get(job + "/scene").status, 409);
  // The worker is free for the next one, and has not taken this one again.
  const std::string next = client.PostScene();
  client.WaitFor(next, "running");
  EXPECT_TRUE(Eventually([&] { return Runs() == 2; }));
  EXPECT_EQ(client.Get(job).Json().at("status"), "canceled");
}

TEST_F(BakeTest, CancelsAQueuedJob) {
  const Service service =
      Start("echo run >> $test/runs; while [ ! -e $test/go ]; do sleep 0.02; done" + kBakes);
  const Client client = service.client();
  const std::string first = client.PostScene();
  const std::string second = client.PostScene();
  client.WaitFor(first, "running");
  EXPECT_EQ(client.Request("POST", second + "/cancel", "Content-Length: 0\r\n").Json().at("status"),
            "canceled");
  const std::string third = client.PostScene();
  WriteFile(folder() / "go", "");
  client.WaitFor(third, "succeeded");
  EXPECT_EQ(client.Get(second).Json().at("status"), "canceled");
  EXPECT_EQ(Runs(), 2);
  EXPECT_EQ(client.Request("POST", third + "/cancel").status, 409);
}

TEST_F(BakeTest, ForgetsADeletedJobWithItsFiles) {
  const Service service = Start("touch $test/started; [ -e $test/go ] || exec sleep 1000" + kBakes);
  const Client client = service.client();
  const std::string running = client.PostScene();
  const std::string queued = client.PostScene();
  EXPECT_TRUE(There("started"));
  EXPECT_EQ(client.Request("DELETE", queued).status, 204);
  EXPECT_FALSE(std::filesystem::exists(Folder(queued)));
  WriteFile(folder() / "go", "");
  EXPECT_EQ(client.Request("DELETE", running).status, 204);
  EXPECT_EQ(client.Get(running).status, 404);
  EXPECT_TRUE(Eventually([&] { return !std::filesystem::exists(Folder(running)); }));
  const std::string done = client.PostScene();
  client.WaitFor(done, "succeeded");
  EXPECT_EQ(client.Request("DELETE", done).status, 204);
  EXPECT_EQ(client.Request("DELETE", done).status, 404);
  EXPECT_TRUE(std::filesystem::is_empty(data() / "jobs"));
}

TEST_F(BakeTest, ForgetsAnEndedJobInItsTime) {
  const std::filesystem::path program = WriteProgram(folder() / "radbake", kBakes);
  const Service service(data(), program, {1, std::chrono::milliseconds(500), Service::SmallLimits(), "", {}});
  const Client client = service.client();
  const std::string job = client.PostScene();
  EXPECT_TRUE(Eventually([&] { return client.Get(job).status == 404; }));
  EXPECT_TRUE(Eventually([&] { return std::filesystem::is_empty(data() / "jobs"); }));
}

TEST_F(BakeTest, SaysWhenAJobWillBeForgotten) {
  const Service service = Start("[ -e $test/go ] || exit 2; " + kBakes);
  const nlohmann::json failed = service.client().WaitFor(service.client().PostScene(), "failed");
  EXPECT_GT(failed.at("expires_at").get<std::string>(), failed.at("ended_at").get<std::string>());
  EXPECT_EQ(failed.at("attempt"), 1);
}

TEST_F(BakeTest, QueuesAgainWhatRanWhenTheServiceStops) {
  std::string job;
  {
    const Service service = Start("touch $test/started; exec sleep 1000");
    job = service.client().PostScene();
    EXPECT_TRUE(There("started"));
  }
  const Service service = Start(kBakes);
  service.client().WaitFor(job, "succeeded");
}

TEST_F(BakeTest, RemovesAtTheStartWhatBelongsToNoJob) {
  std::filesystem::create_directories(data() / "jobs/00112233445566778899aabbccddeeff/upload");
  WriteFile(data() / "jobs/stray", "");
  const Service service = Start(kBakes);
  EXPECT_TRUE(std::filesystem::is_empty(data() / "jobs"));
}

TEST_F(BakeTest, HasItsDataFolderToItself) {
  const Service service = Start(kBakes);
  try {
    const Service second = Start(kBakes);
    FAIL() << "two services use one folder";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("another radbaked uses the data folder"));
  }
}

}  // namespace
}  // namespace radbake::server
