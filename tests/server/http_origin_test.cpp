// Pages of other origins.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/digest.h"
#include "server/http.h"
#include "tests/server/service_test.h"

namespace radbake::server {
namespace {

using ::testing::HasSubstr;

TEST(Origin, IsASchemeAHostAndAPort) {
  EXPECT_TRUE(IsOrigin("https://example.org"));
  EXPECT_TRUE(IsOrigin("http://localhost:8000"));
  EXPECT_TRUE(IsOrigin("http://[::1]:8000"));
  for (const char* other :
       {"", "*", "null", "example.org", "https://", "https://Example.org", "https://example.org/",
        "ftp://example.org", "https://a b", "https://a\r\nb: c"}) {
    EXPECT_FALSE(IsOrigin(other)) << other;
  }
}

class OriginTest : public testing::Test {
 protected:
  Service Start(std::set<std::string> origins) const {
    return {folder_.path() / "data",
            WriteProgram(folder_.path() / "radbake", kBakes),
            {1,
             std::chrono::hours(1),
             Service::SmallLimits(),
             "me " + Sha256Hex("secret") + "\n",
             {},
             0,
             std::move(origins)}};
  }

 private:
  TemporaryFolder folder_;
};

const std::string kOrigin = "Origin: https://example.org\r\n";
const std::string kToken = "Authorization: Bearer secret\r\n";
const std::string kPreflight =
    "Access-Control-Request-Method: POST\r\nAccess-Control-Request-Headers: authorization\r\n";

TEST_F(OriginTest, IsToldNothingUnlessAllowed) {
  const Service service = Start({});
  const Answer answer = service.client().Request("GET", "/v1/bakes", kOrigin + kToken);
  EXPECT_EQ(answer.status, 200);
  EXPECT_FALSE(answer.headers.contains("access-control-allow-origin"));
  EXPECT_EQ(service.client().Request("OPTIONS", "/v1/bakes", kOrigin + kPreflight).status, 405);
}

TEST_F(OriginTest, MayUseTheServiceWhereAllowed) {
  const Service service = Start({"https://example.org", "http://localhost:8000"});
  const Client client = service.client();
  const Answer preflight = client.Request("OPTIONS", "/v1/bakes", kOrigin + kPreflight);
  EXPECT_EQ(preflight.status, 204) << "which carries no token";
  EXPECT_EQ(preflight.headers.at("access-control-allow-origin"), "https://example.org");
  EXPECT_EQ(preflight.headers.at("access-control-allow-methods"), "GET, HEAD, POST");
  EXPECT_THAT(preflight.headers.at("access-control-allow-headers"), HasSubstr("Authorization"));
  EXPECT_EQ(preflight.headers.at("vary"), "Origin");
  EXPECT_FALSE(preflight.headers.contains("content-length"));
  for (const std::string& headers : {kOrigin + kToken, kOrigin}) {
    const Answer answer = client.Request("GET", "/v1/bakes", headers);
    EXPECT_EQ(answer.status, headers == kOrigin ? 401 : 200);
    EXPECT_EQ(answer.headers.at("access-control-allow-origin"), "https://example.org");
    EXPECT_THAT(answer.headers.at("access-control-expose-headers"), HasSubstr("Location"));
    EXPECT_FALSE(answer.headers.contains("access-control-allow-credentials"));
  }
  const Answer held = client.Request(
      "POST", "/v1/bakes",
      kOrigin + kToken + "Content-Type: model/gltf-binary\r\nContent-Length: 12\r\nPrefer: wait=60\r\n",
      Glb());
  EXPECT_EQ(held.status, 200);
  EXPECT_EQ(held.headers.at("access-control-allow-origin"), "https://example.org");
}

TEST_F(OriginTest, IsNoOtherThanTheAllowed) {
  const Service service = Start({"https://example.org"});
  const Client client = service.client();
  for (const std::string other : {"https://example.org.evil.net", "http://example.org", "null", "*"}) {
    const Answer answer = client.Request("GET", "/healthz", "Origin: " + other + "\r\n");
    EXPECT_EQ(answer.status, 200);
    EXPECT_FALSE(answer.headers.contains("access-control-allow-origin")) << other;
    EXPECT_EQ(answer.headers.at("vary"), "Origin") << "a cache must not hand it to the allowed";
    EXPECT_EQ(client.Request("OPTIONS", "/healthz", "Origin: " + other + "\r\n" + kPreflight).status, 405);
  }
  EXPECT_EQ(client.Request("OPTIONS", "/nothing", kOrigin + kPreflight).status, 404);
}

}  // namespace
}  // namespace radbake::server
