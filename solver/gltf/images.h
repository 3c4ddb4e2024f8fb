/// Images of a glTF: never decoded, only carried along.
#pragma once

#include <functional>
#include <string_view>
#include <vector>

#include "solver/gltf/document.h"
#include "solver/gltf/json.h"
#include "solver/gltf/layout.h"

namespace radbake::gltf {

/// Throws InputError for an image that has neither a URI nor a buffer view, or whose URI is not part of the
/// upload or of an unknown format.
void CheckImages(const Json& root, const Source& source);

/// Throws InputError where the images have more pixels together than the limit, by their headers. After
/// CheckImages() and CheckLayout().
void CheckImageSizes(const Json& root, const Source& source, const Layout& layout,
                     const std::vector<std::string_view>& buffers, const Limits& limits);

/// Replaces the URI of each image that is a part of the upload by a buffer view of its bytes, each part once.
/// `append` adds such a view and returns its index. data: URIs stay as they are.
void EmbedImages(Json& root, const Source& source,
                 const std::function<std::size_t(std::string_view bytes)>& append);

}  // namespace radbake::gltf
