/// How large an image is, by its header alone: asked before anything is decoded.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace radbake::gltf {

/// Width times height of a PNG, JPEG, WebP or KTX 2; nothing for another format, and where the header is
/// broken or cut short, of which no decoder makes an image either.
std::optional<std::uint64_t> PixelsOf(std::string_view image);

}  // namespace radbake::gltf
