#include <filesystem>
#include <fstream>
#include <iterator>

#include "solver/gltf/container.h"
#include "solver/gltf/document.h"
#include "solver/gltf/uri.h"

namespace radbake::gltf {
namespace {

namespace fs = std::filesystem;

std::string ReadFile(const fs::path& path, const std::string& name) {
  std::error_code error;
  if (fs::is_directory(path, error)) {
    throw InputError(name + ": is a folder");
  }
  std::ifstream file(path, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  if (!file.is_open() || file.bad()) {
    throw InputError(name + ": cannot be read");
  }
  return bytes;
}

/// Whether `path`, with all symbolic links resolved, stands in or below `folder`.
bool IsInside(const fs::path& folder, const fs::path& path) {
  const fs::path relative = path.lexically_relative(folder);
  return !relative.empty() && *relative.begin() != "..";
}

}  // namespace

Source ReadSource(const std::string& path) {
  Source source;
  source.bytes = ReadFile(path, path);
  const Json root = ParseJson(Split(source.bytes).json, Limits().json_depth);
  const fs::path folder = fs::canonical(fs::path(path)).parent_path();
  for (const char* list : {"buffers", "images"}) {
    const Json& elements = Objects(root, list, {"glTF"});
    for (std::size_t i = 0; i < elements.size(); ++i) {
      const Place place{list == std::string_view("buffers") ? "buffer" : "image", i};
      const std::string uri = Text(elements[i], "uri", "", place);
      if (Find(elements[i], "uri") == nullptr || IsDataUri(uri) || source.resources.count(uri) != 0) {
        continue;
      }
      std::error_code error;
      const fs::path part = fs::canonical(folder / RelativePath(uri, place), error);
      if (error || !fs::is_regular_file(part, error)) {
        Fail(place, "there is no file " + Quoted(uri) + " beside the scene");
      }
      if (!IsInside(folder, part)) {
        Fail(place, "URI " + Quoted(uri) + " leaves the scene's folder");
      }
      source.resources[uri] = ReadFile(part, ToString(place) + ": " + Quoted(uri));
    }
  }
  return source;
}

}  // namespace radbake::gltf
