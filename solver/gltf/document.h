/// glTF at both ends of a bake. The only folder that knows the format.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "solver/bake/baked_scene.h"
#include "solver/scene/scene.h"

namespace radbake::gltf {

/// The bytes of one upload: a .glb, or a .gltf with its buffers and images by the URI that the .gltf uses. No
/// URI is ever opened as a file or fetched; one that is not in `resources` (and not a data: URI) is an error.
struct Source {
  std::string bytes;
  std::map<std::string, std::string> resources;
};

/// Reads SCENE.glb or SCENE.gltf with the files beside it (the command line's side: only relative URIs that
/// stay inside the scene's own folder are read). Throws InputError.
Source ReadSource(const std::string& path);

/// What an upload may ask for at most.
struct Limits {
  std::size_t json_depth = 64;
  std::size_t triangles = 20'000'000;
  std::size_t nodes = 1'000'000;
  std::uint64_t texture_pixels = 1ULL << 28U;  ///< of all images together, by their headers
};

/// A parsed and checked glTF. Copyable handles are not promised; move only. Not thread-safe.
class Document {
 public:
  /// Parses, checks every index and count, and converts to world space. Throws InputError with one line that
  /// names the place ("accessor 3: …"); never reads a file.
  explicit Document(const Source& source, const Limits& limits = {});
  ~Document();
  Document(Document&&) noexcept;
  Document& operator=(Document&&) noexcept;

  const Scene& scene() const;

  /// Sets scene().environment, of which glTF says nothing: the radiance of a uniform sky in cd/m², not
  /// negative.
  void SetEnvironment(const Rgb& radiance);

  /// The document with its surfaces replaced by the baked ones (DESIGN section 4, `vertex`), as one .glb.
  /// `baked.surfaces` is parallel to scene().surfaces.
  std::string Export(const BakedScene& baked) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The surfaces of a baked .glb that carry `_IRRADIANCE`, in world space: what a viewer interpolates. A
/// double-sided input is there twice, with opposite winding. Throws InputError.
BakedTriangles ReadIrradiance(const Source& baked);

}  // namespace radbake::gltf
