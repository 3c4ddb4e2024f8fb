#include "solver/gltf/container.h"

#include <cstdint>

#include "solver/gltf/uri.h"
#include "solver/scene/types.h"

namespace radbake::gltf {
namespace {

constexpr std::string_view kMagic = "glTF";
constexpr std::size_t kHeaderSize = 12;
constexpr std::size_t kChunkHeaderSize = 8;
constexpr std::uint32_t kJsonChunk = 0x4E4F534A;
constexpr std::uint32_t kBinaryChunk = 0x004E4942;

// glTF is little-endian.
std::uint32_t ReadWord(std::string_view bytes, std::size_t offset) {
  std::uint32_t word = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    word |= static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[offset + i])) << (8 * i);
  }
  return word;
}

void AppendWord(std::string& bytes, std::size_t word) {
  for (unsigned i = 0; i < 4; ++i) {
    bytes += static_cast<char>((word >> (8 * i)) & 0xFFU);
  }
}

Chunks SplitGlb(std::string_view bytes) {
  if (bytes.size() < kHeaderSize + kChunkHeaderSize) {
    throw InputError("the .glb is cut short: " + std::to_string(bytes.size()) + " bytes hold no header");
  }
  if (const std::uint32_t version = ReadWord(bytes, 4); version != 2) {
    throw InputError("the .glb is of version " + std::to_string(version) + ", not 2");
  }
  const std::size_t length = ReadWord(bytes, 8);
  if (length > bytes.size()) {
    throw InputError("the .glb is cut short: " + std::to_string(bytes.size()) + " bytes of " +
                     std::to_string(length));
  }
  Chunks chunks;
  bool has_binary = false;
  std::size_t offset = kHeaderSize;
  for (std::size_t chunk = 0; offset + kChunkHeaderSize <= length; ++chunk) {
    const std::size_t size = ReadWord(bytes, offset);
    const std::uint32_t type = ReadWord(bytes, offset + 4);
    offset += kChunkHeaderSize;
    if (size > length - offset) {
      throw InputError("the .glb is cut short: chunk " + std::to_string(chunk) + " says " +
                       std::to_string(size) + " bytes and has " + std::to_string(length - offset));
    }
    if ((chunk == 0) != (type == kJsonChunk)) {
      throw InputError("the .glb does not have its JSON in the first chunk, and there alone");
    }
    if (type == kJsonChunk) {
      chunks.json = bytes.substr(offset, size);
    } else if (type == kBinaryChunk && !has_binary) {
      chunks.binary = bytes.substr(offset, size);
      has_binary = true;
    }
    offset += size;
  }
  return chunks;
}

}  // namespace

Chunks Split(std::string_view bytes) {
  if (bytes.starts_with(kMagic)) {
    return SplitGlb(bytes);
  }
  const std::size_t first = bytes.find_first_not_of(" \t\r\n\xEF\xBB\xBF");
  if (first == std::string_view::npos || bytes[first] != '{') {
    throw InputError("not glTF: neither a .glb nor JSON");
  }
  return {bytes, {}};
}

std::string Join(const Json& root, std::string_view binary) {
  std::string json = root.dump();
  json.append((4 - json.size() % 4) % 4, ' ');
  const std::size_t padding = (4 - binary.size() % 4) % 4;
  const std::size_t binary_chunk = binary.empty() ? 0 : kChunkHeaderSize + binary.size() + padding;
  const std::size_t length = kHeaderSize + kChunkHeaderSize + json.size() + binary_chunk;
  if (length > UINT32_MAX) {
    throw InputError("the baked scene is larger than the 4 GiB that a .glb can hold");
  }
  std::string glb;
  glb.reserve(length);
  glb += kMagic;
  AppendWord(glb, 2);
  AppendWord(glb, length);
  AppendWord(glb, json.size());
  AppendWord(glb, kJsonChunk);
  glb += json;
  if (!binary.empty()) {
    AppendWord(glb, binary.size() + padding);
    AppendWord(glb, kBinaryChunk);
    glb += binary;
    glb.append(padding, '\0');
  }
  return glb;
}

std::vector<std::string_view> ResolveBuffers(const Json& root, std::string_view binary, const Source& source,
                                             std::vector<std::string>& decoded) {
  const Json& list = Objects(root, "buffers", {"glTF"});
  std::vector<std::string_view> buffers;
  decoded.reserve(list.size());
  for (std::size_t i = 0; i < list.size(); ++i) {
    const Place place{"buffer", i};
    const std::size_t length = Count(list[i], "byteLength", place);
    std::string_view bytes;
    if (Find(list[i], "uri") == nullptr) {
      if (i != 0 || binary.empty()) {
        Fail(place, "has no data");
      }
      bytes = binary;
    } else if (const std::string uri = Text(list[i], "uri", "", place); IsDataUri(uri)) {
      decoded.push_back(DecodeDataUri(uri, place));
      bytes = decoded.back();
    } else {
      bytes = Part(source, uri, place);
    }
    if (length > bytes.size()) {
      Fail(place, "says " + std::to_string(length) + " bytes and has " + std::to_string(bytes.size()));
    }
    buffers.push_back(bytes.substr(0, length));
  }
  return buffers;
}

std::string_view Part(const Source& source, std::string_view uri, const Place& place) {
  const std::string path = RelativePath(uri, place);
  for (const std::string& name : {std::string(uri), path}) {
    if (const auto found = source.resources.find(name); found != source.resources.end()) {
      return found->second;
    }
  }
  Fail(place, "URI " + Quoted(uri) + " is not part of the upload");
}

std::string_view MediaType(std::string_view image) {
  if (image.starts_with("\x89PNG\r\n\x1A\n")) {
    return "image/png";
  }
  if (image.starts_with("\xFF\xD8\xFF")) {
    return "image/jpeg";
  }
  if (image.starts_with("RIFF") && image.substr(0, 12).ends_with("WEBP")) {
    return "image/webp";
  }
  if (image.starts_with("\xABKTX 20\xBB\r\n\x1A\n")) {
    return "image/ktx2";
  }
  return {};
}

}  // namespace radbake::gltf
