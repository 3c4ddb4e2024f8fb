#include "solver/gltf/file.h"

#include "solver/gltf/container.h"
#include "solver/gltf/features.h"
#include "solver/gltf/images.h"

namespace radbake::gltf {
namespace {

void CheckVersion(const Json& root) {
  const Json* asset = FindObject(root, "asset", {"glTF"});
  if (asset == nullptr) {
    throw InputError("asset: is missing");
  }
  const std::string version = Text(*asset, "minVersion", Text(*asset, "version", "", {"asset"}), {"asset"});
  if (version != "2.0") {
    Fail({"asset"}, "glTF version " + Quoted(version) + " is not 2.0");
  }
}

}  // namespace

File::File(const Source& source, const Limits& limits) {
  const Chunks chunks = Split(source.bytes);
  root = ParseJson(chunks.json, limits.json_depth);
  CheckVersion(root);
  CheckExtensions(root);
  CheckRequiredExtensions(root);
  buffers = ResolveBuffers(root, chunks.binary, source, decoded);
  layout = CheckLayout(root, buffers, limits);
  CheckImages(root, source);
  CheckImageSizes(root, source, layout, buffers, limits);
}

}  // namespace radbake::gltf
