// The files of a job that has succeeded.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/http_test.h"

namespace radbake::server {
namespace {

using ::testing::HasSubstr;

class ResultsTest : public HttpTest {};

TEST_F(ResultsTest, HasNoResultBeforeTheEnd) {
  const std::string job = client().PostScene();
  for (const char* part : {"/scene", "/statistics"}) {
    const Answer answer = client().Get(job + part);
    EXPECT_EQ(answer.status, 409);
    EXPECT_EQ(answer.headers.at("content-type"), "application/problem+json");
    EXPECT_EQ(answer.headers.at("retry-after"), "1");
  }
}

TEST_F(ResultsTest, HandsOutTheResult) {
  WriteFile(Go(), "");
  const std::string job = client().PostScene();
  const nlohmann::json end = client().WaitFor(job, "succeeded");
  EXPECT_EQ(end.at("progress"), 1);
  EXPECT_FALSE(end.at("ended_at").is_null());
  EXPECT_FALSE(end.contains("error"));
  const Answer scene = client().Get(end.at("links").at("scene"));
  EXPECT_EQ(scene.status, 200);
  EXPECT_EQ(scene.headers.at("content-type"), "model/gltf-binary");
  EXPECT_EQ(scene.headers.at("content-length"), "10");
  EXPECT_EQ(scene.body, "glTF baked");
  const Answer statistics = client().Get(end.at("links").at("statistics"));
  EXPECT_EQ(statistics.status, 200);
  EXPECT_EQ(statistics.headers.at("content-type"), "application/json");
  EXPECT_EQ(statistics.body, R"({"version":"0"})");
  const Answer head = client().Request("HEAD", job + "/scene");
  EXPECT_EQ(head.status, 200);
  EXPECT_EQ(head.headers.at("content-length"), "10");
  EXPECT_EQ(head.body, "");
  EXPECT_FALSE(client().Get(job).headers.contains("retry-after"));
}

TEST_F(ResultsTest, ServesOneRangeOfAResult) {
  WriteFile(Go(), "");
  const std::string job = client().PostScene();
  client().WaitFor(job, "succeeded");
  const auto get = [&](const std::string& headers) {
    return client().Request("GET", job + "/scene", headers);
  };
  const Answer part = get("Range: bytes=2-5\r\n");
  EXPECT_EQ(part.status, 206);
  EXPECT_EQ(part.body, "TF b");
  EXPECT_EQ(part.headers.at("content-range"), "bytes 2-5/10");
  EXPECT_EQ(part.headers.at("content-length"), "4");
  EXPECT_EQ(get("Range: bytes=-3\r\n").body, "ked");
  EXPECT_EQ(get("Range: bytes=7-\r\n").body, "ked");
  EXPECT_EQ(get("Range: bytes=7-99\r\n").body, "ked");
  const Answer none = get("Range: bytes=10-\r\n");
  EXPECT_EQ(none.status, 416);
  EXPECT_EQ(none.headers.at("content-range"), "bytes */10");
  // Overlapping ranges would multiply what is sent: several are served as the whole.
  const Answer whole = get("Range: bytes=0-3,2-5,1-9\r\n");
  EXPECT_EQ(whole.status, 200);
  EXPECT_EQ(whole.body, "glTF baked");
  EXPECT_EQ(whole.headers.at("accept-ranges"), "bytes");
  EXPECT_EQ(get("Range: bytes=2-5\r\nIf-Range: " + whole.headers.at("etag") + "\r\n").status, 206);
  EXPECT_EQ(get("Range: bytes=2-5\r\nIf-Range: \"other\"\r\n").status, 200);
  EXPECT_EQ(client().Request("GET", job, "Range: bytes=0-1\r\n").status, 200) << "a job changes";
}

TEST_F(ResultsTest, SendsAResultOnceToWhoKeepsItsTag) {
  WriteFile(Go(), "");
  const std::string job = client().PostScene();
  client().WaitFor(job, "succeeded");
  const std::string tag = client().Get(job + "/scene").headers.at("etag");
  EXPECT_NE(tag, client().Get(job + "/statistics").headers.at("etag"));
  const Answer same = client().Request("GET", job + "/scene", "If-None-Match: \"x\", " + tag + "\r\n");
  EXPECT_EQ(same.status, 304);
  EXPECT_EQ(same.body, "");
  EXPECT_EQ(same.headers.at("etag"), tag);
  EXPECT_FALSE(same.headers.contains("content-length"));
  EXPECT_EQ(client().Request("GET", job + "/scene", "If-None-Match: \"x\"\r\n").status, 200);
}

TEST_F(ResultsTest, PacksStatisticsForWhoTakesGzip) {
  WriteFile(Go(), "");
  const std::string job = client().PostScene();
  client().WaitFor(job, "succeeded");
  const Answer packed = client().Request("GET", job + "/statistics", "Accept-Encoding: br, gzip\r\n");
  EXPECT_EQ(packed.status, 200);
  EXPECT_EQ(packed.headers.at("content-encoding"), "gzip");
  EXPECT_EQ(packed.headers.at("vary"), "Accept-Encoding");
  EXPECT_EQ(packed.body.substr(0, 2), "\x1F\x8B");
  const Answer plain = client().Get(job + "/statistics");
  EXPECT_FALSE(plain.headers.contains("content-encoding"));
  EXPECT_NE(plain.headers.at("etag"), packed.headers.at("etag"));
  EXPECT_FALSE(client()
                   .Request("GET", job + "/scene", "Accept-Encoding: gzip\r\n")
                   .headers.contains("content-encoding"));
}

TEST_F(ResultsTest, SaysThatThereIsNoLightmap) {
  WriteFile(Go(), "");
  const std::string job = client().PostScene();
  client().WaitFor(job, "succeeded");
  const Answer answer = client().Get(job + "/lightmap");
  EXPECT_EQ(answer.status, 404);
  EXPECT_THAT(answer.Json().at("detail").get<std::string>(), HasSubstr("no lightmap"));
}

}  // namespace
}  // namespace radbake::server
