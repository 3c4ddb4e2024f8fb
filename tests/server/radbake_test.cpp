// The service with the real radbake.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <cstring>

#include "tests/server/service_test.h"

namespace radbake::server {
namespace {

using ::testing::HasSubstr;

class RadbakeTest : public testing::Test {
 protected:
  RadbakeTest() : service_(data(), RADBAKE_BINARY_DIR "/radbake") {}
  Client client() const { return service_.client(); }

  std::string PostParts(const std::vector<FormPart>& parts) const {
    const Answer answer = client().PostForm(parts);
    EXPECT_EQ(answer.status, 202) << answer.body;
    return answer.status == 202 ? answer.headers.at("location") : "";
  }
  // What a .gltf of this content fails with.
  std::string Failure(const std::string& gltf) const {
    const nlohmann::json error = client().WaitFor(PostParts({{"scene", gltf, ""}}), "failed").at("error");
    EXPECT_EQ(error.at("status"), 422);
    return error.at("detail");
  }

 private:
  std::filesystem::path data() const { return folder_.path() / "data"; }

  TemporaryFolder folder_;
  Service service_;
};

std::string BevyGlb() {
  return ReadFile(RADBAKE_SOURCE_DIR "/../shared/scenes/cornell-box-bevy.glb");
}

const std::string kQuick = R"({"error": 0.2, "check": 0})";

TEST_F(RadbakeTest, BakesAGlb) {
  const std::string job = PostParts({{"scene", BevyGlb(), "scene.glb"}, {"parameters", kQuick, ""}});
  client().WaitFor(job, "succeeded");
  const std::string baked = client().Get(job + "/scene").body;
  EXPECT_THAT(baked.substr(0, 4), "glTF");
  EXPECT_THAT(baked, HasSubstr("_IRRADIANCE"));
  const nlohmann::json statistics = client().Get(job + "/statistics").Json();
  EXPECT_EQ(statistics.at("parameters").at("error"), 0.2);
  EXPECT_FALSE(statistics.at("iterations").empty());
}

TEST_F(RadbakeTest, BakesAGltfWithItsBufferAsAPart) {
  const std::string glb = BevyGlb();
  std::uint32_t json_size = 0;
  std::memcpy(&json_size, glb.data() + 12, sizeof json_size);
  nlohmann::json gltf = nlohmann::json::parse(glb.substr(20, json_size));
  gltf["buffers"][0]["uri"] = "data/box%20buffer.bin";
  const std::string buffer = glb.substr(20 + json_size + 8);
  const std::string job = PostParts(
      {{"data/box buffer.bin", buffer, ""}, {"scene", gltf.dump(), "box.gltf"}, {"parameters", kQuick, ""}});
  client().WaitFor(job, "succeeded");
  EXPECT_THAT(client().Get(job + "/scene").body, HasSubstr("_IRRADIANCE"));
}

TEST_F(RadbakeTest, FailsWithOneSentenceOnABadScene) {
  EXPECT_THAT(Failure(R"({"asset":{"version":"2.0"}})"), HasSubstr("no triangles"));
  EXPECT_NE(Failure("{"), "");
  EXPECT_NE(Failure(std::string(100'000, '[').replace(0, 5, R"({"a":)")), "");
  const std::string uri = R"({"asset":{"version":"2.0"},"buffers":[{"byteLength":9,"uri":")";
  for (const std::string outside :
       {"../../parameters.json", "../parameters.json", "/etc/passwd", "http://host/a.bin"}) {
    EXPECT_THAT(Failure(uri + outside + "\"}]}"), HasSubstr(outside));
  }
  EXPECT_THAT(Failure(uri + "missing.bin\"}]}"), HasSubstr("missing.bin"));
}

TEST_F(RadbakeTest, StopsABakeThatIsCanceled) {
  const std::string job = PostParts({{"scene", BevyGlb(), ""}, {"parameters", R"({"error": 0.001})", ""}});
  client().WaitFor(job, "running");
  EXPECT_TRUE(Eventually([&] { return client().Get(job).Json().at("phase").is_string(); }));
  EXPECT_EQ(client().Request("POST", job + "/cancel").status, 200);
  // The one worker is free again.
  client().WaitFor(PostParts({{"scene", BevyGlb(), ""}, {"parameters", kQuick, ""}}), "succeeded");
  EXPECT_EQ(client().Get(job).Json().at("status"), "canceled");
}

}  // namespace
}  // namespace radbake::server
