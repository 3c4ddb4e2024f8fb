/// The one BIN chunk of a baked .glb: new data, and of the input's what is still in use.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "solver/gltf/file.h"
#include "solver/gltf/references.h"

namespace radbake::gltf {

/// Adds buffer views and accessors to a document, then packs it.
class Packer {
 public:
  /// `root` starts as a copy of `file.root`; both must outlive the packer.
  Packer(const File& file, Json& root) : file_(file), root_(root) {}

  /// Adds a buffer view. Returns its index.
  std::size_t AddView(std::string_view bytes);

  enum class Bounds { kNo, kYes };

  /// Adds an accessor of floats, `width` a vertex (1 to 4, 9 or 16), with its minimum and maximum if asked.
  std::size_t AddVertices(const std::vector<float>& values, std::size_t width, Bounds bounds = Bounds::kNo);

  /// Adds an accessor of indices below `vertices`, as short as they fit.
  std::size_t AddIndices(const std::vector<std::uint32_t>& indices, std::size_t vertices);

  /// Takes out of the document the accessors, buffer views and bytes that nothing refers to any more, and
  /// makes all buffers one, the first. Returns its bytes. Where there is an extension that may refer to
  /// accessors in a way of its own, accessors and views all stay and keep their numbers.
  std::string Pack();

 private:
  void DropUnused(const char* list, Target target);
  std::string PackViews();

  const File& file_;
  Json& root_;
  std::string added_;  ///< bytes of the added views, whose buffer is one beyond the input's
};

}  // namespace radbake::gltf
