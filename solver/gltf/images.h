/// Images of a glTF: never decoded, only carried along.
#pragma once

#include <functional>
#include <string_view>

#include "solver/gltf/document.h"
#include "solver/gltf/json.h"

namespace radbake::gltf {

/// Throws InputError for an image that has neither a URI nor a buffer view, or whose URI is not part of the
/// upload or of an unknown format.
void CheckImages(const Json& root, const Source& source);

/// Replaces the URI of each image that is a part of the upload by a buffer view of its bytes, each part once.
/// `append` adds such a view and returns its index. data: URIs stay as they are.
void EmbedImages(Json& root, const Source& source,
                 const std::function<std::size_t(std::string_view bytes)>& append);

}  // namespace radbake::gltf
