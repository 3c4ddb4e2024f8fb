#include "solver/gltf/uri.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdint>
#include <optional>

namespace radbake::gltf {
namespace {

constexpr std::uint8_t kNoDigit = 64;

constexpr std::array<std::uint8_t, 256> kBase64 = [] {
  std::array<std::uint8_t, 256> values{};
  values.fill(kNoDigit);
  constexpr std::string_view kAlphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  for (std::size_t i = 0; i < kAlphabet.size(); ++i) {
    values[static_cast<unsigned char>(kAlphabet[i])] = static_cast<std::uint8_t>(i);
  }
  return values;
}();

std::optional<unsigned> HexDigit(char c) {
  if (c >= '0' && c <= '9') {
    return static_cast<unsigned>(c - '0');
  }
  const char lower = static_cast<char>(static_cast<unsigned char>(c) | 0x20U);
  if (lower >= 'a' && lower <= 'f') {
    return static_cast<unsigned>(lower - 'a' + 10);
  }
  return std::nullopt;
}

}  // namespace

bool IsDataUri(std::string_view uri) {
  constexpr std::string_view kScheme = "data:";
  return uri.size() >= kScheme.size() &&
         std::equal(kScheme.begin(), kScheme.end(), uri.begin(), [](char expected, char c) {
           return expected == static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
         });
}

std::string DecodeDataUri(std::string_view uri, const Place& place) {
  constexpr std::string_view kEncoding = ";base64";
  const std::size_t comma = uri.find(',');
  if (comma == std::string_view::npos || !uri.substr(0, comma).ends_with(kEncoding)) {
    Fail(place, "the data: URI is not base64");
  }
  std::string_view digits = uri.substr(comma + 1);
  for (int padding = 0; padding < 2 && digits.ends_with('='); ++padding) {
    digits.remove_suffix(1);
  }
  if (digits.size() % 4 == 1) {
    Fail(place, "the data: URI is cut short");
  }
  std::string bytes;
  bytes.reserve(digits.size() / 4 * 3 + 2);
  std::uint32_t bits = 0;
  unsigned pending = 0;
  for (const char c : digits) {
    const std::uint32_t value = kBase64[static_cast<unsigned char>(c)];
    if (value == kNoDigit) {
      Fail(place, "the data: URI is not base64");
    }
    bits = (bits << 6U) | value;
    pending += 6;
    if (pending >= 8) {
      pending -= 8;
      bytes += static_cast<char>((bits >> pending) & 0xFFU);
    }
  }
  return bytes;
}

std::string RelativePath(std::string_view uri, const Place& place) {
  std::string path;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    if (uri[i] != '%') {
      path += uri[i];
      continue;
    }
    const std::optional<unsigned> high = i + 2 < uri.size() ? HexDigit(uri[i + 1]) : std::nullopt;
    const std::optional<unsigned> low = i + 2 < uri.size() ? HexDigit(uri[i + 2]) : std::nullopt;
    if (!high || !low) {
      Fail(place, "URI " + Quoted(uri) + " has a bad percent code");
    }
    path += static_cast<char>(*high * 16 + *low);
    i += 2;
  }
  bool leaves = path.empty() || path.front() == '/';
  for (const char c : path) {
    leaves = leaves || c == '\\' || c == ':' || static_cast<unsigned char>(c) < 0x20;
  }
  for (std::size_t begin = 0; begin <= path.size();) {
    const std::size_t end = std::min(path.find('/', begin), path.size());
    leaves = leaves || std::string_view(path).substr(begin, end - begin) == "..";
    begin = end + 1;
  }
  if (leaves) {
    Fail(place, "URI " + Quoted(uri) + " leaves the upload");
  }
  return path;
}

}  // namespace radbake::gltf
