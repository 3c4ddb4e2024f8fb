#include "solver/gltf/image_size.h"

#include <cstddef>

#include "solver/gltf/container.h"

namespace radbake::gltf {
namespace {

using Pixels = std::optional<std::uint64_t>;

// `count` bytes from `at`, the first one the most significant; nothing beyond the end.
Pixels BigEndian(std::string_view bytes, std::size_t at, std::size_t count) {
  if (at > bytes.size() || bytes.size() - at < count) {
    return std::nullopt;
  }
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < count; ++i) {
    value = (value << 8U) | static_cast<unsigned char>(bytes[at + i]);
  }
  return value;
}

Pixels LittleEndian(std::string_view bytes, std::size_t at, std::size_t count) {
  if (at > bytes.size() || bytes.size() - at < count) {
    return std::nullopt;
  }
  std::uint64_t value = 0;
  for (std::size_t i = count; i-- > 0;) {
    value = (value << 8U) | static_cast<unsigned char>(bytes[at + i]);
  }
  return value;
}

Pixels Product(const Pixels& width, const Pixels& height) {
  return width && height ? Pixels(*width * *height) : std::nullopt;
}

// ISO/IEC 15948, 11.2.2: IHDR is the first chunk.
Pixels Png(std::string_view image) {
  constexpr std::size_t kWidth = 16;
  const bool header = image.substr(12, 4) == "IHDR";
  return header ? Product(BigEndian(image, kWidth, 4), BigEndian(image, kWidth + 4, 4)) : std::nullopt;
}

// ITU-T T.81, B.1.1.3: segments until the frame header (SOF), which holds the size.
Pixels Jpeg(std::string_view image) {
  std::size_t at = 2;
  while (at + 4 <= image.size() && image[at] == '\xFF') {
    const auto marker = static_cast<unsigned char>(image[at + 1]);
    const bool stands_alone = marker == 0xFF || marker == 0x01 || (marker >= 0xD0 && marker <= 0xD7);
    if (stands_alone) {
      at += marker == 0xFF ? 1 : 2;
      continue;
    }
    const bool frame = marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
    if (frame) {
      return Product(BigEndian(image, at + 7, 2), BigEndian(image, at + 5, 2));
    }
    at += 2 + BigEndian(image, at + 2, 2).value_or(0);
  }
  return std::nullopt;
}

// RFC 9649, 2.5 to 2.7: lossy, lossless, extended.
Pixels WebP(std::string_view image) {
  const std::string_view kind = image.substr(12, 4);
  if (kind == "VP8X") {
    const Pixels width = LittleEndian(image, 24, 3);
    const Pixels height = LittleEndian(image, 27, 3);
    return width && height ? Pixels((*width + 1) * (*height + 1)) : std::nullopt;
  }
  if (kind == "VP8L") {
    const Pixels bits = LittleEndian(image, 21, 4);
    return bits ? Pixels(((*bits & 0x3FFFU) + 1) * (((*bits >> 14U) & 0x3FFFU) + 1)) : std::nullopt;
  }
  const Pixels width = LittleEndian(image, 26, 2);
  const Pixels height = LittleEndian(image, 28, 2);
  return kind == "VP8 " && width && height ? Pixels((*width & 0x3FFFU) * (*height & 0x3FFFU)) : std::nullopt;
}

// KTX 2.0, 3.2 and 3.3: a height of 0 is that of a row.
Pixels Ktx(std::string_view image) {
  const Pixels height = LittleEndian(image, 24, 4);
  return Product(LittleEndian(image, 20, 4), height == Pixels(0) ? Pixels(1) : height);
}

}  // namespace

std::optional<std::uint64_t> PixelsOf(std::string_view image) {
  const std::string_view type = MediaType(image);
  if (type == "image/png") {
    return image.size() < 16 ? std::nullopt : Png(image);
  }
  if (type == "image/jpeg") {
    return Jpeg(image);
  }
  if (type == "image/webp") {
    return image.size() < 16 ? std::nullopt : WebP(image);
  }
  return type == "image/ktx2" ? Ktx(image) : std::nullopt;
}

}  // namespace radbake::gltf
