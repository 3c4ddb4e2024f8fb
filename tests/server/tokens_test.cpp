#include "server/tokens.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/digest.h"
#include "tests/server/service_test.h"

namespace radbake::server {
namespace {

using ::testing::HasSubstr;

// The second is of "abc", as FIPS 180-2 gives it.
const std::string kAlice = "alice " + Sha256Hex("secret-of-alice");
const std::string kBob = "bob  ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad  # since May";
const std::string kFile = "# who may\n\n" + kAlice + "\n" + kBob + "\n";

TEST(Tokens, BelongToTheirOwners) {
  const Tokens tokens(kFile);
  EXPECT_EQ(tokens.Owner("Bearer secret-of-alice"), "alice");
  EXPECT_EQ(tokens.Owner("Bearer abc"), "bob");
  for (const char* other : {"", "Bearer", "Bearer ", "Bearer abcd", "abc", "Basic abc", "Bearer  abc",
                            "Bearer ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"}) {
    EXPECT_FALSE(tokens.Owner(other)) << other;
  }
}

TEST(Tokens, AFileOfThemIsRightOrNamesItsLine) {
  const auto error = [](const std::string& text) {
    try {
      const Tokens tokens(text);
      return std::string("none");
    } catch (const std::runtime_error& caught) {
      return std::string(caught.what());
    }
  };
  EXPECT_THAT(error(kAlice + "\n" + kAlice), HasSubstr("line 2"));
  EXPECT_THAT(error(kAlice + "\ncarol secret"), HasSubstr("line 2"));
  EXPECT_THAT(error(kAlice + " more"), HasSubstr("line 1"));
  EXPECT_THAT(error("a/b " + Sha256Hex("x")), HasSubstr("line 1"));
  EXPECT_THAT(error("\n# nobody"), HasSubstr("no token"));
}

TEST(Rate, GivesSoManyAtOnceAndThenEvenly) {
  Rate rate(2);
  const Rate::Clock::time_point start;
  EXPECT_FALSE(rate.Take("a", start));
  EXPECT_FALSE(rate.Take("a", start));
  EXPECT_EQ(rate.Take("a", start), std::chrono::seconds(30));
  EXPECT_FALSE(rate.Take("b", start)) << "each owner has its own";
  EXPECT_EQ(rate.Take("a", start + std::chrono::seconds(20)), std::chrono::seconds(10));
  EXPECT_FALSE(rate.Take("a", start + std::chrono::seconds(31)));
  EXPECT_FALSE(Rate(0).Take("a", start));
}

class TokensTest : public testing::Test {
 protected:
  Service Start(const HttpLimits& limits) const {
    return {folder_.path() / "data",
            WriteProgram(folder_.path() / "radbake", "exec sleep 1000"),
            {1, std::chrono::hours(1), limits, kFile, {}}};
  }
  static Answer Ask(const Service& service, const std::string& method, const std::string& path,
                    const std::string& token) {
    return service.client().Request(method, path, "Authorization: Bearer " + token + "\r\n");
  }
  static Answer Post(const Service& service, const std::string& token) {
    return service.client().Request(
        "POST", "/v1/bakes",
        "Content-Type: model/gltf-binary\r\nContent-Length: 12\r\nAuthorization: Bearer " + token + "\r\n",
        Glb());
  }

 private:
  TemporaryFolder folder_;
};

TEST_F(TokensTest, NobodyElseIsLetIn) {
  const Service service = Start({});
  const Answer answer = service.client().Post(Glb(), "model/gltf-binary");
  EXPECT_EQ(answer.status, 401);
  EXPECT_EQ(answer.headers.at("www-authenticate"), "Bearer");
  EXPECT_EQ(service.client().Get("/v1/bakes").status, 401);
  EXPECT_EQ(Ask(service, "GET", "/v1/bakes/00112233445566778899aabbccddeeff", "wrong").status, 401);
  EXPECT_EQ(service.client().Get("/healthz").status, 200);
}

TEST_F(TokensTest, EachSeesItsOwnJobsAlone) {
  const Service service = Start({});
  const Answer made = Post(service, "secret-of-alice");
  ASSERT_EQ(made.status, 202) << made.body;
  const std::string job = made.headers.at("location");
  EXPECT_EQ(Ask(service, "GET", job, "secret-of-alice").status, 200);
  for (const char* part : {"", "/scene", "/statistics", "/lightmap", "/events"}) {
    EXPECT_EQ(Ask(service, "GET", job + part, "abc").status, 404) << part;
  }
  EXPECT_EQ(Ask(service, "DELETE", job, "abc").status, 404);
  EXPECT_EQ(Ask(service, "POST", job + "/cancel", "abc").status, 404);
  EXPECT_EQ(Ask(service, "GET", "/v1/bakes", "secret-of-alice").Json().at("bakes").size(), 1U);
  EXPECT_TRUE(Ask(service, "GET", "/v1/bakes", "abc").Json().at("bakes").empty());
  const Answer held =
      service.client().Request("GET", job, "Prefer: wait=1\r\nAuthorization: Bearer secret-of-alice\r\n");
  EXPECT_EQ(held.status, 200);
  EXPECT_EQ(held.headers.at("preference-applied"), "wait=1");
}

TEST_F(TokensTest, NobodyUploadsMoreThanAllowed) {
  HttpLimits limits;
  limits.uploads_a_minute = 2;
  const Service service = Start(limits);
  EXPECT_EQ(Post(service, "abc").status, 202);
  EXPECT_EQ(Post(service, "abc").status, 202);
  const Answer third = Post(service, "abc");
  EXPECT_EQ(third.status, 429);
  EXPECT_THAT(third.body, HasSubstr("2 uploads a minute"));
  EXPECT_THAT(std::atoi(third.headers.at("retry-after").c_str()),
              testing::AllOf(testing::Ge(1), testing::Le(30)));
  EXPECT_EQ(Post(service, "secret-of-alice").status, 202);
}

TEST_F(TokensTest, NobodyFillsTheQueue) {
  HttpLimits limits;
  limits.queued_of_one = 1;
  limits.queued = 2;
  const Service service = Start(limits);
  const std::string running = Post(service, "abc").headers.at("location");
  EXPECT_TRUE(
      Eventually([&] { return Ask(service, "GET", running, "abc").Json().at("status") == "running"; }));
  EXPECT_EQ(Post(service, "abc").status, 202);
  const Answer own = Post(service, "abc");
  EXPECT_EQ(own.status, 429);
  EXPECT_THAT(own.body, HasSubstr("1 jobs"));
  EXPECT_EQ(Post(service, "secret-of-alice").status, 202);
  const Answer all = Post(service, "secret-of-alice");
  EXPECT_EQ(all.status, 503);
  EXPECT_THAT(all.body, HasSubstr("2 jobs"));
  EXPECT_EQ(all.headers.at("retry-after"), "1");
}

}  // namespace
}  // namespace radbake::server
