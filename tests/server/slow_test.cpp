// Clients that take their time, or never come to an end: they hold up nobody but themselves. The service has
// the patience of an hour here: whoever waited for such a client would wait for that long.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>

#include "tests/server/service_test.h"

namespace radbake::server {
namespace {

using ::testing::HasSubstr;

constexpr int kCrowd = 100;  // more than there are threads

class SlowTest : public testing::Test {
 protected:
  static HttpLimits Patient() {
    HttpLimits limits = Service::SmallLimits();
    limits.head_time = std::chrono::hours(1);
    limits.idle_time = std::chrono::hours(1);
    limits.uploads = 1;
    limits.downloads = 1;
    return limits;
  }
  // Bakes leave results that no socket holds.
  Service Start() const {
    return {folder_.path() / "data",
            WriteProgram(folder_.path() / "radbake",
                         "for name in baked.glb statistics.json; do head -c 30000000 /dev/zero > "
                         "attempt/$name; done"),
            {1, std::chrono::hours(1), Patient(), "", {}}};
  }
  // So many clients that send this, and then neither send nor read.
  static std::vector<Descriptor> Crowd(const Service& service, const std::string& request) {
    std::vector<Descriptor> crowd;
    crowd.reserve(kCrowd);
    for (int i = 0; i < kCrowd; ++i) {
      crowd.push_back(Connect(service.port(), request));
    }
    return crowd;
  }
  static std::string Baked(const Service& service) {
    const std::string job = service.client().PostScene();
    service.client().WaitFor(job, "succeeded");
    return job;
  }

 private:
  TemporaryFolder folder_;
};

TEST_F(SlowTest, WhoIsRefusedAndGoesOnSendingHoldsNobodyUp) {
  const Service service = Start();
  for (const std::string request :
       {"POST /v1/bakes HTTP/1.1\r\nContent-Type: text/plain\r\nContent-Length: 1000\r\n\r\nabc",
        "DELETE /v1/bakes/00112233445566778899aabbccddeeff HTTP/1.1\r\nContent-Length: 1000\r\n\r\nabc",
        "PUT / HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n3\r\nabc\r\n",
        "GET /healthz HTTP/1.1\r\nContent-Length: 1000\r\n\r\nabc", "GET / HTTP/1.1\r\nno header\r\n\r\n"}) {
    const std::vector<Descriptor> crowd = Crowd(service, request);
    EXPECT_EQ(service.client().Get("/healthz").status, 200) << request;
    std::string answer;
    EXPECT_TRUE(ReceiveUntil(crowd.back(), "}", answer)) << request << answer;
  }
}

TEST_F(SlowTest, UploadsThatStandStillHoldUpNoOtherRequest) {
  const Service service = Start();
  const std::vector<Descriptor> crowd =
      Crowd(service,
            "POST /v1/bakes HTTP/1.1\r\nContent-Type: model/gltf-binary\r\nContent-Length: 1000\r\n\r\nglTF");
  EXPECT_EQ(service.client().Get("/healthz").status, 200);
}

TEST_F(SlowTest, WhoDoesNotReadHoldsNobodyUp) {
  const Service service = Start();
  const std::string job = Baked(service);
  for (const char* part : {"/scene", "/statistics"}) {
    const std::vector<Descriptor> crowd = Crowd(service, "GET " + job + part + " HTTP/1.1\r\n\r\n");
    EXPECT_EQ(service.client().Get("/healthz").status, 200) << part;
  }
}

TEST_F(SlowTest, SendsSoManyResultsAtATimeAndSaysSo) {
  const Service service = Start();
  const std::string job = Baked(service);
  Descriptor reader = Connect(service.port(), "GET " + job + "/scene HTTP/1.1\r\n\r\n");
  std::string begin;
  ASSERT_TRUE(ReceiveUntil(reader, "\r\n\r\n", begin)) << begin;
  const Answer full = service.client().Get(job + "/scene");
  EXPECT_EQ(full.status, 503);
  EXPECT_EQ(full.headers.at("retry-after"), "1");
  EXPECT_THAT(full.body, HasSubstr("the 1 downloads"));
  EXPECT_EQ(service.client().Request("HEAD", job + "/scene").status, 200);
  reader.Close();
  EXPECT_TRUE(Eventually([&] { return service.client().Get(job + "/scene").body.size() == 30'000'000; }));
}

TEST_F(SlowTest, StopsWhateverItsClientsDo) {
  std::vector<Descriptor> clients;
  {
    const Service service = Start();
    const std::string job = Baked(service);
    clients.push_back(Connect(service.port(), "GET " + job + "/scene HTTP/1.1\r\n\r\n"));
    clients.push_back(Connect(service.port(), "GET / HTTP"));
    clients.push_back(
        Connect(service.port(),
                "POST /v1/bakes HTTP/1.1\r\nExpect: 100-continue\r\nContent-Type: model/gltf-binary\r\n"
                "Content-Length: 1000\r\n\r\n"));
    std::string asked;
    ASSERT_TRUE(ReceiveUntil(clients.back(), "100 Continue\r\n\r\n", asked)) << asked;
  }
  std::string answer;
  EXPECT_TRUE(ReceiveUntil(clients.back(), "the server is stopping", answer)) << answer;
}

}  // namespace
}  // namespace radbake::server
