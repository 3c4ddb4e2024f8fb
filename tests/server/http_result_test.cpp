#include "server/http_result.h"

#include <gtest/gtest.h>
#include <zlib.h>

namespace radbake::server {
namespace {

TEST(Range, IsAPartOfWhatIsThere) {
  const auto part = [](const char* header) {
    const Range range = ParseRange(header, 10);
    EXPECT_EQ(range.kind, Range::Kind::kPart) << header;
    return std::pair(range.offset, range.length);
  };
  using Part = std::pair<std::uint64_t, std::uint64_t>;
  EXPECT_EQ(part("bytes=0-0"), Part(0, 1));
  EXPECT_EQ(part("bytes=2-5"), Part(2, 4));
  EXPECT_EQ(part("bytes=2-"), Part(2, 8));
  EXPECT_EQ(part("bytes=2-18446744073709551615"), Part(2, 8));
  EXPECT_EQ(part("bytes=-4"), Part(6, 4));
  EXPECT_EQ(part("bytes=-400"), Part(0, 10));
}

TEST(Range, IsNothingBeyondTheEnd) {
  for (const char* header : {"bytes=10-", "bytes=10-20", "bytes=18446744073709551615-", "bytes=-0"}) {
    EXPECT_EQ(ParseRange(header, 10).kind, Range::Kind::kNone) << header;
  }
}

TEST(Range, IsLeftUnservedWhereItIsNotOnePlainRange) {
  for (const char* header :
       {"", "bytes", "bytes=", "bytes=-", "bytes=a-b", "bytes=5-2", "bytes=1-2,4-5", "lines=1-2", "bytes=1",
        "bytes=--1", "bytes=99999999999999999999-", "bytes=1-x"}) {
    EXPECT_EQ(ParseRange(header, 10).kind, Range::Kind::kWhole) << header;
  }
}

TEST(Tags, AreFoundInAList) {
  EXPECT_TRUE(HasTag("\"a\"", "\"a\""));
  EXPECT_TRUE(HasTag("\"b\" , W/\"a\"", "\"a\""));
  EXPECT_TRUE(HasTag("*", "\"a\""));
  EXPECT_FALSE(HasTag("", "\"a\""));
  EXPECT_FALSE(HasTag("\"ab\", a", "\"a\""));
}

TEST(Gzip, IsTakenByWhoSaysSo) {
  EXPECT_TRUE(TakesGzip("gzip"));
  EXPECT_TRUE(TakesGzip("deflate, gzip;q=0.5"));
  EXPECT_FALSE(TakesGzip(""));
  EXPECT_FALSE(TakesGzip("br"));
  EXPECT_FALSE(TakesGzip("gzip;q=0"));
  EXPECT_FALSE(TakesGzip("gzip; q=0.00"));
}

TEST(Gzip, GivesBackWhatWasPacked) {
  std::string text;
  for (int i = 0; i < 1000; ++i) {
    text += std::to_string(i * i);
  }
  std::string packed = Gzip(text);
  EXPECT_LT(packed.size(), text.size());
  z_stream stream{};
  ASSERT_EQ(inflateInit2(&stream, 15 + 16), Z_OK);
  std::string unpacked(text.size() + 1, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_in = static_cast<uInt>(packed.size());
  stream.next_out = reinterpret_cast<Bytef*>(unpacked.data());
  stream.avail_out = static_cast<uInt>(unpacked.size());
  EXPECT_EQ(inflate(&stream, Z_FINISH), Z_STREAM_END);
  unpacked.resize(stream.total_out);
  inflateEnd(&stream);
  EXPECT_EQ(unpacked, text);
}

}  // namespace
}  // namespace radbake::server
