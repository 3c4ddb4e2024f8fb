// The web page's files; tests/page bakes with them in a browser.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/http_test.h"

namespace radbake::server {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class PageTest : public HttpTest {};

TEST_F(PageTest, LoadsNothingButWhatTheServiceServes) {
  const Answer page = client().Get("/");
  EXPECT_EQ(page.status, 200);
  EXPECT_EQ(page.headers.at("content-type"), "text/html; charset=utf-8");
  EXPECT_EQ(page.headers.at("x-content-type-options"), "nosniff");
  const std::string policy = page.headers.at("content-security-policy");
  EXPECT_THAT(policy, HasSubstr("default-src 'none'"));
  EXPECT_THAT(policy, HasSubstr("frame-ancestors 'none'"));
  EXPECT_THAT(policy, Not(HasSubstr("unsafe")));
  EXPECT_THAT(page.body, Not(HasSubstr("<style")));
  EXPECT_THAT(page.body, Not(HasSubstr("://")));
  for (const char* part : {"/page.css", "/page.js"}) {
    EXPECT_EQ(client().Get(part).status, 200) << part;
    EXPECT_THAT(page.body, HasSubstr(std::string(part).substr(1)));
  }
}

TEST_F(PageTest, ComesPackedAndOnce) {
  const Answer plain = client().Get("/page.js");
  const Answer packed = client().Request("GET", "/page.js", "Accept-Encoding: gzip\r\n");
  EXPECT_EQ(packed.headers.at("content-encoding"), "gzip");
  EXPECT_LT(packed.body.size(), plain.body.size());
  EXPECT_NE(packed.headers.at("etag"), plain.headers.at("etag"));
  const std::string tag = plain.headers.at("etag");
  EXPECT_EQ(client().Request("GET", "/page.js", "If-None-Match: " + tag + "\r\n").status, 304);
  EXPECT_EQ(client().Request("HEAD", "/page.js").headers.at("content-length"),
            std::to_string(plain.body.size()));
}

TEST_F(PageTest, HasItsModulesByPathsThatABrowserFinds) {
  const Answer loader = client().Get("/three/examples/jsm/loaders/GLTFLoader.js");
  ASSERT_EQ(loader.status, 200) << "three.js was not there when this was built: deploy/install picture";
  EXPECT_EQ(loader.headers.at("content-type"), "text/javascript; charset=utf-8");
  EXPECT_THAT(loader.body, Not(HasSubstr("from 'three'")));
  EXPECT_EQ(client().Get("/three/build/three.module.js").status, 200);
  EXPECT_EQ(client().Get("/three/../three/build/three.module.js").status, 404);
}

}  // namespace
}  // namespace radbake::server
