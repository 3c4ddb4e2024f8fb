// Posts that come again.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/http_test.h"

namespace radbake::server {
namespace {

class IdempotencyTest : public HttpTest {};

TEST_F(IdempotencyTest, MakesOneJobOfARepeatedPost) {
  const auto post = [&](const std::string& key, const std::string& scene) {
    return client().Request("POST", "/v1/bakes",
                            "Content-Type: model/gltf-binary\r\nIdempotency-Key: " + key +
                                "\r\nContent-Length: " + std::to_string(scene.size()) + "\r\n",
                            scene);
  };
  const Answer first = post("key-1", Glb("abc"));
  ASSERT_EQ(first.status, 202) << first.body;
  const Answer again = post("key-1", Glb("abc"));
  EXPECT_EQ(again.status, 202);
  EXPECT_EQ(again.headers.at("location"), first.headers.at("location"));
  const Answer other = post("key-1", Glb("abd"));
  EXPECT_EQ(other.status, 422);
  EXPECT_EQ(other.Json().at("type"), "urn:radbake:problem:key-reused");
  EXPECT_NE(post("key-2", Glb("abc")).headers.at("location"), first.headers.at("location"));
  EXPECT_EQ(post("with space", Glb("abc")).status, 400);
  EXPECT_EQ(post(std::string(256, 'k'), Glb("abc")).status, 400);
  using Folders = std::filesystem::directory_iterator;
  EXPECT_EQ(std::distance(Folders(data() / "jobs"), Folders()), 2)
      << "nothing is left of the repeated uploads";
  WriteFile(Go(), "");
  client().WaitFor(first.headers.at("location"), "succeeded");
  EXPECT_EQ(post("key-1", Glb("abc")).status, 200);
  client().Request("DELETE", first.headers.at("location"));
  EXPECT_NE(post("key-1", Glb("abc")).headers.at("location"), first.headers.at("location"));
}

TEST_F(IdempotencyTest, TellsAPayloadByItsPartsAlone) {
  const auto post = [&](const std::string& border, const std::vector<FormPart>& parts) {
    std::string body;
    for (const FormPart& part : parts) {
      body += "--" + border + "\r\nContent-Disposition: form-data; name=\"" + part.name + "\"\r\n\r\n" +
              part.content + "\r\n";
    }
    body += "--" + border + "--\r\n";
    const Answer answer =
        client().Request("POST", "/v1/bakes",
                         "Idempotency-Key: form\r\nContent-Type: multipart/form-data; boundary=" + border +
                             "\r\nContent-Length: " + std::to_string(body.size()) + "\r\n",
                         body);
    return answer.status;
  };
  EXPECT_EQ(post("one", {{"scene", Glb(), ""}, {"parameters", "{}", ""}}), 202);
  EXPECT_EQ(post("two", {{"parameters", "{}", ""}, {"scene", Glb(), ""}}), 202);
  EXPECT_EQ(post("one", {{"scene", Glb(), ""}, {"parameters", "{ }", ""}}), 422);
  EXPECT_EQ(post("one", {{"scene", Glb(), ""}}), 422);
}

}  // namespace
}  // namespace radbake::server
