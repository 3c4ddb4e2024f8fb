/// A glTF file, parsed and checked as a whole.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "solver/gltf/document.h"
#include "solver/gltf/json.h"
#include "solver/gltf/layout.h"

namespace radbake::gltf {

/// Refers to the Source that it was opened from. Neither copied nor moved: its parts refer to each other.
struct File {
  File(const Source& source, const Limits& limits);  ///< Throws InputError.
  File(const File&) = delete;
  File& operator=(const File&) = delete;

  Json root;
  std::vector<std::string> decoded;  ///< bytes of data: URIs
  std::vector<std::string_view> buffers;
  Layout layout;
};

}  // namespace radbake::gltf
