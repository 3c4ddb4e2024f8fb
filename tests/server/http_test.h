/// The service with a stand-in for radbake that holds every bake, for tests of what is seen over HTTP.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "tests/server/service_test.h"

namespace radbake::server {

/// The path of a job that is not there.
inline const std::string kNoJob = "/v1/bakes/00112233445566778899aabbccddeeff";

/// A service whose bakes wait until the file "go" is there.
class HttpTest : public testing::Test {
 protected:
  HttpTest()
      : service_(data(), WriteProgram(folder_.path() / "radbake", "while [ ! -e " + Go().string() +
                                                                      " ]; do sleep 0.02; done\n" + kBakes)) {
  }
  std::filesystem::path data() const { return folder_.path() / "data"; }
  std::filesystem::path Go() const { return folder_.path() / "go"; }
  Client client() const { return service_.client(); }
  int port() const { return service_.port(); }

  /// An answer that is one problem of RFC 9457, and no job was made.
  void ExpectProblem(const Answer& answer, int status, const std::string& detail) const {
    EXPECT_EQ(answer.status, status) << answer.body;
    ASSERT_TRUE(answer.headers.contains("content-type"));
    EXPECT_EQ(answer.headers.at("content-type"), "application/problem+json");
    const nlohmann::json problem = answer.Json();
    ASSERT_TRUE(problem.is_object()) << answer.body;
    EXPECT_EQ(problem.at("status"), status);
    EXPECT_TRUE(problem.at("type").is_string());
    EXPECT_TRUE(problem.at("title").is_string());
    EXPECT_THAT(problem.at("detail").get<std::string>(), testing::HasSubstr(detail));
    EXPECT_TRUE(std::filesystem::is_empty(data() / "jobs"));
  }

 private:
  TemporaryFolder folder_;
  Service service_;
};

}  // namespace radbake::server
