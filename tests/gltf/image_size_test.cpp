// The size of an image by its header, and the limit on all of them.
#include "solver/gltf/image_size.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/gltf/builder_test.h"

namespace radbake::gltf {
namespace {

using std::string_literals::operator""s;
using testing::HasSubstr;

const std::string kPng = "\x89PNG\r\n\x1A\n\0\0\0\rIHDR\0\0\2\0\0\0\1\0\x8\2\0\0\0"s;  // 512 × 256
// 640 × 480: an APP0 and a quantisation table stand before the frame, and a byte of filling.
const std::string kJpeg = "\xFF\xD8\xFF\xE0\0\4JF\xFF\xDB\0\3q\xFF\xFF\xC2\0\x11\x8\1\xE0\2\x80\3"s;

TEST(ImageSize, IsReadFromTheHeader) {
  EXPECT_EQ(PixelsOf(kPng), 512U * 256U);
  EXPECT_EQ(PixelsOf(kJpeg), 640U * 480U);
  EXPECT_EQ(PixelsOf("RIFF\x20\0\0\0WEBPVP8X\xA\0\0\0\0\0\0\0\x3F\1\0\xEF\0\0"s), 320U * 240U);
  // 300 × 200 of 14 bits each, less one: 299 | 199 << 14.
  EXPECT_EQ(PixelsOf("RIFF\x20\0\0\0WEBPVP8L\x8\0\0\0\x2F\x2B\xC1\x31\0"s), 300U * 200U);
  EXPECT_EQ(PixelsOf("RIFF\x20\0\0\0WEBPVP8 \xA\0\0\0\0\0\0\x9D\1\x2A\x90\1\x2C\1"s), 400U * 300U);
  EXPECT_EQ(PixelsOf("\xABKTX 20\xBB\r\n\x1A\n\0\0\0\0\0\0\0\0\0\4\0\0\0\2\0\0"s), 1024U * 512U);
}

TEST(ImageSize, IsNothingWhereTheHeaderIsCutShortOrBroken) {
  for (const std::string& image : {kPng, kJpeg}) {
    for (std::size_t size = 0; size < image.size() - 5; ++size) {
      EXPECT_FALSE(PixelsOf(image.substr(0, size)).has_value() && size < 20) << size;
    }
  }
  EXPECT_FALSE(PixelsOf("\xFF\xD8\xFF\xE0\0\0\0\0\0\0\0\0"s)) << "a segment without a length";
  EXPECT_FALSE(PixelsOf("\xFF\xD8" + std::string(1000, '\xFF')));
  EXPECT_FALSE(PixelsOf("GIF89a"));
  EXPECT_FALSE(PixelsOf(""));
}

TEST(ImageSize, OfAllImagesTogetherIsLimited) {
  Builder builder = OneTriangle();
  const std::vector<char> png(kPng.begin(), kPng.end());
  builder.Add("images", {{"mimeType", "image/png"}, {"bufferView", builder.View(png)}});
  builder.Add("images", {{"uri", "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAgAAAAEACAIAAAA="}});
  builder.Add("images", {{"uri", "beside.jpg"}});
  const Source source{builder.Glb(), {{"beside.jpg", kJpeg}}};
  constexpr std::uint64_t kAll = 2 * 512 * 256 + 640 * 480;
  Limits limits;
  limits.texture_pixels = kAll;
  EXPECT_NO_THROW(Document(source, limits));
  limits.texture_pixels = kAll - 1;
  try {
    const Document document(source, limits);
    FAIL() << "taken";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("image 2: the images have more than the limit of 569343 pixels"));
  }
}

}  // namespace
}  // namespace radbake::gltf
