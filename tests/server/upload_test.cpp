#include "server/upload.h"

#include <gtest/gtest.h>

#include "server/problem.h"

namespace radbake::server {
namespace {

TEST(ResourcePath, IsTheDecodedRelativePath) {
  EXPECT_EQ(ResourcePath("box.bin"), "box.bin");
  EXPECT_EQ(ResourcePath("textures/oak wood.png"), "textures/oak wood.png");
  EXPECT_EQ(ResourcePath("textures/oak%20wood.png"), "textures/oak wood.png");
  EXPECT_EQ(ResourcePath("./a/./b.bin"), "a/b.bin");
  EXPECT_EQ(ResourcePath("100%.png"), "100%.png");
  EXPECT_EQ(ResourcePath("%C3%A4%c3%bc"), "äü");
  EXPECT_EQ(ResourcePath("..a/b..bin"), "..a/b..bin");
}

class HostileName : public testing::TestWithParam<std::string> {};

TEST_P(HostileName, IsRefused) {
  try {
    const std::string path = ResourcePath(GetParam());
    FAIL() << "taken as " << path;
  } catch (const ProblemError& error) {
    EXPECT_EQ(error.problem().status, 422);
  }
}

INSTANTIATE_TEST_SUITE_P(ResourcePath, HostileName,
                         testing::Values("", ".", "./", "/", "/etc/passwd", "../x", "a/../../x", "a/..", "..",
                                         "%2e%2e/x", "..%2fx", "%2Fetc", "a//b", "a/", "a\\b", "..\\x",
                                         "a%5Cb", "c:x", "http://host/x", "file:///etc/passwd",
                                         std::string("a\0b", 3), "a%00b", "a\nb", "a\x7f",
                                         std::string(201, 'a'), "1/2/3/4/5/6/7/8/9"));

}  // namespace
}  // namespace radbake::server
