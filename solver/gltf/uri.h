/// The URIs of a glTF, none of which is ever followed: data: URIs hold bytes, all others are names in an
/// upload.
#pragma once

#include <string>
#include <string_view>

#include "solver/gltf/json.h"

namespace radbake::gltf {

bool IsDataUri(std::string_view uri);

/// The bytes of a base64 data: URI. Throws InputError.
std::string DecodeDataUri(std::string_view uri, const Place& place);

/// The relative path that a URI names, percent-decoded. Throws InputError for one that could leave the folder
/// of the scene: absolute, with a scheme or a host, with "..", a backslash or a control character.
std::string RelativePath(std::string_view uri, const Place& place);

}  // namespace radbake::gltf
