#include "solver/gltf/images.h"

#include <map>

#include "solver/gltf/container.h"
#include "solver/gltf/image_size.h"
#include "solver/gltf/uri.h"

namespace radbake::gltf {
namespace {

std::string MediaTypeOf(const Json& image, std::string_view bytes, const Place& place) {
  const std::string_view found = MediaType(bytes);
  return found.empty() ? Text(image, "mimeType", "", place) : std::string(found);
}

}  // namespace

void CheckImages(const Json& root, const Source& source) {
  const Json& images = Objects(root, "images", {"glTF"});
  for (std::size_t i = 0; i < images.size(); ++i) {
    const Place place{"image", i};
    const bool has_uri = Find(images[i], "uri") != nullptr;
    if (has_uri == (Find(images[i], "bufferView") != nullptr)) {
      Fail(place, "has not one of uri and bufferView");
    }
    const std::string uri = Text(images[i], "uri", "", place);
    if (has_uri && !IsDataUri(uri) && MediaTypeOf(images[i], Part(source, uri, place), place).empty()) {
      Fail(place, Quoted(uri) + " is not an image of a known format");
    }
  }
}

void CheckImageSizes(const Json& root, const Source& source, const Layout& layout,
                     const std::vector<std::string_view>& buffers, const Limits& limits) {
  const Json& images = Objects(root, "images", {"glTF"});
  std::uint64_t left = limits.texture_pixels;
  for (std::size_t i = 0; i < images.size(); ++i) {
    const Place place{"image", i};
    std::uint64_t pixels = 0;
    if (const auto index = FindIndex(images[i], "bufferView", layout.views.size(), place)) {
      const View& view = layout.views[*index];
      pixels = PixelsOf(buffers[view.buffer].substr(view.offset, view.length)).value_or(0);
    } else {
      const std::string uri = Text(images[i], "uri", "", place);
      pixels = (IsDataUri(uri) ? PixelsOf(DecodeDataUri(uri, place)) : PixelsOf(Part(source, uri, place)))
                   .value_or(0);
    }
    if (pixels > left) {
      Fail(place, "the images have more than the limit of " + std::to_string(limits.texture_pixels) +
                      " pixels together");
    }
    left -= pixels;
  }
}

void EmbedImages(Json& root, const Source& source,
                 const std::function<std::size_t(std::string_view)>& append) {
  Json* images = Find(root, "images");
  std::map<const char*, std::size_t> embedded;
  for (std::size_t i = 0; images != nullptr && i < images->size(); ++i) {
    Json& image = (*images)[i];
    const Place place{"image", i};
    const std::string uri = Text(image, "uri", "", place);
    if (Find(image, "uri") == nullptr || IsDataUri(uri)) {
      continue;
    }
    const std::string_view bytes = Part(source, uri, place);
    auto found = embedded.find(bytes.data());
    if (found == embedded.end()) {
      found = embedded.emplace(bytes.data(), append(bytes)).first;
    }
    image["mimeType"] = MediaTypeOf(image, bytes, place);
    image["bufferView"] = found->second;
    image.erase("uri");
  }
}

}  // namespace radbake::gltf
