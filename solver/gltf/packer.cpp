#include "solver/gltf/packer.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <map>
#include <utility>

namespace radbake::gltf {
namespace {

constexpr std::size_t kAlignment = 4;
constexpr int kVertexData = 34962;  // ARRAY_BUFFER
constexpr int kIndexData = 34963;   // ELEMENT_ARRAY_BUFFER

void Align(std::string& bytes) {
  bytes.append((kAlignment - bytes.size() % kAlignment) % kAlignment, '\0');
}

template <class T>
std::string_view BytesOf(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

std::size_t Append(Json& root, const char* list, Json element) {
  Json& elements = root[list];
  elements.push_back(std::move(element));
  return elements.size() - 1;
}

const char* TypeOf(std::size_t width) {
  switch (width) {
    case 1:
      return "SCALAR";
    case 2:
      return "VEC2";
    case 3:
      return "VEC3";
    case 4:
      return "VEC4";
    case 9:
      return "MAT3";
    default:
      return "MAT4";
  }
}

/// Parts of the input's buffers that are still in use. Views may overlap, and two buffers may be one part of
/// the upload; no byte is copied twice.
class KeptRanges {
 public:
  explicit KeptRanges(const std::vector<std::string_view>& buffers) : buffers_(buffers) {
    std::map<const char*, std::size_t> firsts;
    for (std::size_t i = 0; i < buffers.size(); ++i) {
      same_as_.push_back(firsts.try_emplace(buffers[i].data(), i).first->second);
    }
  }

  void Add(const View& view) {
    ranges_.push_back({same_as_[view.buffer], view.offset, view.offset + view.length, 0});
  }

  void CopyTo(std::string& binary) {
    const auto before = [](const Range& a, const Range& b) {
      return std::pair(a.buffer, a.begin) < std::pair(b.buffer, b.begin);
    };
    std::sort(ranges_.begin(), ranges_.end(), before);
    std::vector<Range> merged;
    for (const Range& range : ranges_) {
      if (!merged.empty() && merged.back().buffer == range.buffer && range.begin <= merged.back().end) {
        merged.back().end = std::max(merged.back().end, range.end);
      } else {
        merged.push_back(range);
      }
    }
    ranges_ = std::move(merged);
    for (Range& range : ranges_) {
      // What was aligned stays so.
      Align(binary);
      binary.append(range.begin % kAlignment, '\0');
      range.offset = binary.size();
      binary.append(buffers_[range.buffer].data() + range.begin, range.end - range.begin);
    }
  }

  /// Where a view that was added stands in `binary`.
  std::size_t OffsetOf(const View& view) const {
    const auto after = std::upper_bound(
        ranges_.begin(), ranges_.end(), std::pair(same_as_[view.buffer], view.offset),
        [](const auto& at, const Range& range) { return at < std::pair(range.buffer, range.begin); });
    const Range& range = *std::prev(after);
    return range.offset + (view.offset - range.begin);
  }

 private:
  struct Range {
    std::size_t buffer, begin, end;
    std::size_t offset;
  };

  const std::vector<std::string_view>& buffers_;
  std::vector<std::size_t> same_as_;  ///< the first buffer of the same bytes
  std::vector<Range> ranges_;
};

View ReadView(const Json& view) {
  return {view.at("buffer").get<std::size_t>(), view.value("byteOffset", std::size_t{0}),
          view.at("byteLength").get<std::size_t>(), 0};
}

/// Takes the compressed twins of buffer views out: the data that was read, which is not compressed, is what
/// stays.
void DropMeshopt(Json& root) {
  constexpr const char* kMeshopt = "EXT_meshopt_compression";
  for (Json& view : root["bufferViews"]) {
    const auto extensions = view.find("extensions");
    if (extensions != view.end() && extensions->erase(kMeshopt) != 0 && extensions->empty()) {
      view.erase("extensions");
    }
  }
  if (Json* used = Find(root, "extensionsUsed")) {
    used->erase(std::remove(used->begin(), used->end(), kMeshopt), used->end());
    if (used->empty()) {
      root.erase("extensionsUsed");
    }
  }
}

}  // namespace

std::size_t Packer::AddView(std::string_view bytes) {
  Align(added_);
  Json view = {{"buffer", file_.buffers.size()}, {"byteOffset", added_.size()}, {"byteLength", bytes.size()}};
  added_ += bytes;
  return Append(root_, "bufferViews", std::move(view));
}

std::size_t Packer::AddVertices(const std::vector<float>& values, std::size_t width, Bounds bounds) {
  const std::size_t view = AddView(BytesOf(values));
  root_["bufferViews"].back()["target"] = kVertexData;
  Json accessor = {{"bufferView", view},
                   {"componentType", static_cast<int>(Component::kFloat)},
                   {"count", values.size() / width},
                   {"type", TypeOf(width)}};
  if (bounds == Bounds::kYes) {
    std::vector<float> low(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(width));
    std::vector<float> high = low;
    for (std::size_t i = width; i < values.size(); ++i) {
      low[i % width] = std::min(low[i % width], values[i]);
      high[i % width] = std::max(high[i % width], values[i]);
    }
    accessor["min"] = low;
    accessor["max"] = high;
  }
  return Append(root_, "accessors", std::move(accessor));
}

std::size_t Packer::AddIndices(const std::vector<std::uint32_t>& indices, std::size_t vertices) {
  // The largest number of a type is not an index.
  const bool is_short = vertices <= UINT16_MAX;
  const std::size_t view = AddView(
      is_short ? BytesOf(std::vector<std::uint16_t>(indices.begin(), indices.end())) : BytesOf(indices));
  root_["bufferViews"].back()["target"] = kIndexData;
  return Append(root_, "accessors",
                {{"bufferView", view},
                 {"componentType", static_cast<int>(is_short ? Component::kUint16 : Component::kUint32)},
                 {"count", indices.size()},
                 {"type", "SCALAR"}});
}

void Packer::DropUnused(const char* list, Target target) {
  const auto found = root_.find(list);
  if (found == root_.end()) {
    return;
  }
  constexpr std::size_t kUnused = SIZE_MAX;
  std::vector<std::size_t> numbers(found->size(), kUnused);
  ForEachReference(root_, [&](Json& index, Target of, const Place&) {
    if (of == target) {
      numbers[index.get<std::size_t>()] = 0;
    }
  });
  Json kept = Json::array();
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (numbers[i] != kUnused) {
      numbers[i] = kept.size();
      kept.push_back(std::move((*found)[i]));
    }
  }
  if (kept.empty()) {
    root_.erase(list);
  } else {
    *found = std::move(kept);
  }
  ForEachReference(root_, [&](Json& index, Target of, const Place&) {
    if (of == target) {
      index = numbers[index.get<std::size_t>()];
    }
  });
}

std::string Packer::Pack() {
  if (OpaqueExtensions(root_).empty()) {
    DropUnused("accessors", Target::kAccessor);
    DropUnused("bufferViews", Target::kBufferView);
  }
  std::string binary = PackViews();
  if (binary.empty()) {
    root_.erase("buffers");
    return binary;
  }
  Json& buffers = root_["buffers"];
  Json buffer = buffers.empty() ? Json::object() : std::move(buffers[0]);
  buffer.erase("uri");
  buffer["byteLength"] = binary.size();
  buffers = Json::array({std::move(buffer)});
  return binary;
}

std::string Packer::PackViews() {
  std::string binary;
  Json* views = Find(root_, "bufferViews");
  if (views == nullptr) {
    return binary;
  }
  DropMeshopt(root_);
  KeptRanges kept(file_.buffers);
  for (const Json& view : *views) {
    if (const View old = ReadView(view); old.buffer < file_.buffers.size()) {
      kept.Add(old);
    }
  }
  kept.CopyTo(binary);
  Align(binary);
  const std::size_t added_at = binary.size();
  binary += added_;
  for (Json& view : *views) {
    const View at = ReadView(view);
    view["byteOffset"] = at.buffer < file_.buffers.size() ? kept.OffsetOf(at) : added_at + at.offset;
    view["buffer"] = 0;
  }
  return binary;
}

}  // namespace radbake::gltf
