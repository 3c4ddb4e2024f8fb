// The limits that are flags of radbaked: each refusal names its limit.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/service_test.h"

namespace radbake::server {
namespace {

using ::testing::HasSubstr;

class LimitsTest : public testing::Test {
 protected:
  // What the job of this scene fails with where radbaked has been given this limit.
  nlohmann::json Failure(const std::string& flag, const std::string& value, const std::string& scene) const {
    Daemon daemon(folder_.path() / "data", RADBAKE_BINARY_DIR "/radbake", {flag, value});
    const Answer posted =
        daemon.client().PostForm({{"scene", scene, ""}, {"parameters", R"({"check":0})", ""}});
    EXPECT_EQ(posted.status, 202) << posted.body;
    return daemon.client().WaitFor(posted.headers.at("location"), "failed").at("error");
  }

 private:
  TemporaryFolder folder_;
};

TEST_F(LimitsTest, OfAScene) {
  const std::string box = ReadFile(RADBAKE_SOURCE_DIR "/scenes/furnace-box.glb");
  const nlohmann::json triangles = Failure("--max-triangles", "5", box);
  EXPECT_EQ(triangles.at("status"), 422);
  EXPECT_EQ(triangles.at("type"), "urn:radbake:problem:scene");
  EXPECT_THAT(triangles.at("detail").get<std::string>(), HasSubstr("the limit of 5 "));
  EXPECT_THAT(Failure("--max-nodes", "0", box).at("detail").get<std::string>(), HasSubstr("the limit of 0"));
  EXPECT_THAT(Failure("--max-json-depth", "3", box).at("detail").get<std::string>(),
              HasSubstr("nested deeper than 3"));
  // 512 × 256 by its header, which is all that there is of it.
  const std::string image = R"({"asset":{"version":"2.0"},"images":[{"uri":"data:image/png;base64,)"
                            R"(iVBORw0KGgoAAAANSUhEUgAAAgAAAAEACAIAAAA="}]})";
  EXPECT_THAT(Failure("--max-texture-pixels", "131071", image).at("detail").get<std::string>(),
              HasSubstr("the limit of 131071 pixels"));
  EXPECT_THAT(Failure("--max-texture-pixels", "131072", image).at("detail").get<std::string>(),
              HasSubstr("no triangles"));
}

TEST_F(LimitsTest, OfAForm) {
  TemporaryFolder own;
  Daemon daemon(own.path() / "data", WriteProgram(own.path() / "radbake", kBakes), {"--max-parts", "2"});
  const Answer answer =
      daemon.client().PostForm({{"a", "", ""}, {"b", "", ""}, {"scene", R"({"asset":{}})", ""}});
  EXPECT_EQ(answer.status, 413);
  EXPECT_THAT(answer.Json().at("detail").get<std::string>(), HasSubstr("the 2 parts that are taken"));
}

}  // namespace
}  // namespace radbake::server
