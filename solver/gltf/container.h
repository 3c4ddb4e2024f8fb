/// The container of a glTF: a .glb's header and chunks, or a .gltf and the parts beside it.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "solver/gltf/document.h"
#include "solver/gltf/json.h"

namespace radbake::gltf {

/// Views into the bytes that it was split from.
struct Chunks {
  std::string_view json;
  std::string_view binary;  ///< empty for a .gltf and for a .glb without
};

/// Tells .glb from .gltf by the first bytes. Throws InputError for what is neither, and for a .glb that is
/// cut short or not version 2.
Chunks Split(std::string_view bytes);

/// One .glb: version 2, chunks padded to 4 bytes.
std::string Join(const Json& root, std::string_view binary);

/// The bytes of each buffer, cut to its byteLength: views into `binary`, into the parts of the upload and,
/// for data: URIs, into `decoded`, which must not move afterwards. Throws InputError.
std::vector<std::string_view> ResolveBuffers(const Json& root, std::string_view binary, const Source& source,
                                             std::vector<std::string>& decoded);

/// The part of the upload that a URI (not a data: URI) names, as written or percent-decoded. Throws
/// InputError.
std::string_view Part(const Source& source, std::string_view uri, const Place& place);

/// "image/png" and the like by the first bytes; empty for a format that glTF does not know.
std::string_view MediaType(std::string_view image);

}  // namespace radbake::gltf
