// Who waits for a job: streams of events, held answers.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/service_test.h"

namespace radbake::server {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

class WatchTest : public testing::Test {
 protected:
  // Bakes tell half of their progress and wait until the file "go" is there.
  Service Start(HttpLimits limits = Service::SmallLimits()) const {
    return {folder_.path() / "data",
            WriteProgram(folder_.path() / "radbake",
                         "echo '{\"phase\":\"solve\",\"progress\":0.5}'\nwhile [ ! -e " + Go().string() +
                             " ]; do sleep 0.02; done\n" + kBakes),
            {1, std::chrono::hours(1), limits, "", {}}};
  }
  std::filesystem::path Go() const { return folder_.path() / "go"; }

  static Descriptor Watch(const Service& service, const std::string& job, const std::string& headers = "") {
    return Connect(service.port(), "GET " + job + "/events HTTP/1.1\r\nHost: x\r\n" + headers + "\r\n");
  }
  // No watcher is taken any more. One that is taken is gone at once.
  static bool Full(const Service& service, const std::string& job) {
    std::string text;
    return ReceiveUntil(Watch(service, job), "\r\n\r\n", text) && text.starts_with("HTTP/1.1 503");
  }
  static std::string LastId(const std::string& stream) {
    const std::size_t begin = stream.rfind("\nid: ") + 5;
    return stream.substr(begin, stream.find('\n', begin) - begin);
  }

 private:
  TemporaryFolder folder_;
};

TEST_F(WatchTest, TellsEveryChangeUntilTheEnd) {
  const Service service = Start();
  const std::string job = service.client().PostScene();
  const Descriptor watcher = Watch(service, job);
  std::string stream;
  ASSERT_TRUE(ReceiveUntil(watcher, R"("progress":0.5)", stream)) << stream;
  EXPECT_THAT(stream, StartsWith("HTTP/1.1 200"));
  EXPECT_THAT(stream, HasSubstr("Content-Type: text/event-stream"));
  EXPECT_THAT(stream, Not(HasSubstr("Content-Length")));
  EXPECT_THAT(stream, HasSubstr("event: job\nid: "));
  WriteFile(Go(), "");
  ASSERT_TRUE(ReceiveUntil(watcher, R"("status":"succeeded")", stream)) << stream;
  EXPECT_FALSE(ReceiveUntil(watcher, "never", stream)) << "the stream ends with the job";
  const std::string data = stream.substr(stream.rfind("data: ") + 6);
  EXPECT_EQ(nlohmann::json::parse(data), service.client().Get(job).Json());
}

TEST_F(WatchTest, GoesOnAfterTheEventThatWasSeenLast) {
  const Service service = Start();
  const std::string job = service.client().PostScene();
  std::string seen;
  ASSERT_TRUE(ReceiveUntil(Watch(service, job), R"("progress":0.5)", seen));
  ASSERT_TRUE(Eventually([&] { return service.client().Get(job).Json().at("progress") == 0.5; }));
  const Descriptor again = Watch(service, job, "Last-Event-ID: " + LastId(seen) + "\r\n");
  std::string stream;
  ASSERT_TRUE(ReceiveUntil(again, "\r\n\r\n", stream));
  WriteFile(Go(), "");
  ASSERT_TRUE(ReceiveUntil(again, R"("status":"succeeded")", stream));
  EXPECT_THAT(stream, Not(HasSubstr(R"("status":"running")"))) << "it has seen that";
  const std::string last = LastId(stream);
  EXPECT_EQ(service.client().Request("GET", job + "/events", "Last-Event-ID: " + last + "\r\n").status, 204);
  EXPECT_THAT(service.client().Request("GET", job + "/events", "Last-Event-ID: x\r\n").body,
              HasSubstr("succeeded"));
}

TEST_F(WatchTest, GivesSignsOfLife) {
  HttpLimits limits = Service::SmallLimits();
  limits.comment = std::chrono::seconds(1);
  const Service service = Start(limits);
  std::string stream;
  EXPECT_TRUE(ReceiveUntil(Watch(service, service.client().PostScene()), "\n:\n\n", stream)) << stream;
}

TEST_F(WatchTest, EndsTheStreamOfADeletedJob) {
  const Service service = Start();
  const std::string job = service.client().PostScene();
  const Descriptor watcher = Watch(service, job);
  std::string stream;
  ASSERT_TRUE(ReceiveUntil(watcher, "event: job", stream));
  EXPECT_EQ(service.client().Request("DELETE", job).status, 204);
  EXPECT_FALSE(ReceiveUntil(watcher, "never", stream));
}

TEST_F(WatchTest, WatchersStarveNobody) {
  const Service service = Start();
  const std::string job = service.client().PostScene();
  std::vector<Descriptor> watchers;
  watchers.reserve(200);
  for (int i = 0; i < 200; ++i) {
    watchers.push_back(Watch(service, job));
  }
  for (const Descriptor& watcher : watchers) {
    std::string stream;
    ASSERT_TRUE(ReceiveUntil(watcher, "event: job", stream));
  }
  EXPECT_EQ(service.client().Get(job).status, 200);
  WriteFile(Go(), "");
  for (const Descriptor& watcher : watchers) {
    std::string stream;
    ASSERT_TRUE(ReceiveUntil(watcher, "succeeded", stream)) << stream;
  }
}

TEST_F(WatchTest, TakesNoMoreWatchersThanAllowed) {
  HttpLimits limits = Service::SmallLimits();
  limits.watchers = 1;
  const Service service = Start(limits);
  const std::string job = service.client().PostScene();
  Descriptor watcher = Watch(service, job);
  std::string stream;
  ASSERT_TRUE(ReceiveUntil(watcher, "event: job", stream));
  const Answer full = service.client().Get(job + "/events");
  EXPECT_EQ(full.status, 503);
  EXPECT_EQ(full.headers.at("retry-after"), "1");
  const Answer held = service.client().Request("GET", job, "Prefer: wait=60\r\n");
  EXPECT_EQ(held.status, 200) << "a preference that cannot be met is none";
  EXPECT_FALSE(held.headers.contains("preference-applied"));
  watcher.Close();
  EXPECT_TRUE(Eventually([&] { return !Full(service, job); })) << "its place is free again";
}

TEST_F(WatchTest, HoldsThePostUntilTheJobEnds) {
  const Service service = Start();
  std::thread later([&] {
    const Client client = service.client();
    EXPECT_TRUE(
        Eventually([&] { return !client.Get("/v1/bakes?status=running").Json().at("bakes").empty(); }));
    WriteFile(Go(), "");
  });
  const Answer answer = service.client().Request(
      "POST", "/v1/bakes",
      "Content-Type: model/gltf-binary\r\nPrefer: respond-async, wait=60\r\nContent-Length: 12\r\n", Glb());
  later.join();
  EXPECT_EQ(answer.status, 200);
  EXPECT_EQ(answer.Json().at("status"), "succeeded");
  EXPECT_EQ(answer.headers.at("location"), answer.Json().at("links").at("self").get<std::string>());
  EXPECT_EQ(answer.headers.at("preference-applied"), "wait=60");
}

TEST_F(WatchTest, AnswersAHeldPostWhenItsTimeIsUp) {
  const Service service = Start();
  const Answer answer = service.client().Request(
      "POST", "/v1/bakes", "Content-Type: model/gltf-binary\r\nPrefer: wait=1\r\nContent-Length: 12\r\n",
      Glb());
  EXPECT_EQ(answer.status, 202);
  EXPECT_EQ(answer.headers.at("retry-after"), "1");
  EXPECT_EQ(answer.headers.at("preference-applied"), "wait=1");
  const std::string job = answer.headers.at("location");
  EXPECT_EQ(service.client().Get(job).status, 200);
  EXPECT_EQ(service.client().Request("GET", job, "Radbaked-Held-Status: 202\r\n").status, 200)
      << "a header of the server's own is forged";
}

TEST_F(WatchTest, AnswersHeldRequestsWhenTheServerStops) {
  Answer answer;
  std::thread waiter;
  {
    HttpLimits limits = Service::SmallLimits();
    limits.watchers = 1;
    const Service service = Start(limits);
    const std::string job = service.client().PostScene();
    waiter = std::thread([&answer, job, port = service.port()] {
      answer = Client(port).Request("GET", job, "Prefer: wait=60\r\n");
    });
    EXPECT_TRUE(Eventually([&] { return Full(service, job); }));
  }
  waiter.join();
  EXPECT_EQ(answer.status, 200);
}

}  // namespace
}  // namespace radbake::server
