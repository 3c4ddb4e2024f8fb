#include "solver/gltf/accessor.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>
#include <type_traits>

namespace radbake::gltf {
namespace {

static_assert(std::endian::native == std::endian::little, "glTF's numbers are read in place");

template <class T>
T Load(const char* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof value);
  return value;
}

template <class T>
float ToFloat(const char* bytes, bool normalized) {
  const T value = Load<T>(bytes);
  if (!normalized || std::is_floating_point_v<T>) {
    return static_cast<float>(value);
  }
  return std::max(static_cast<float>(value) / static_cast<float>(std::numeric_limits<T>::max()), -1.0F);
}

float ReadComponent(Component component, const char* bytes, bool normalized) {
  switch (component) {
    case Component::kInt8:
      return ToFloat<std::int8_t>(bytes, normalized);
    case Component::kUint8:
      return ToFloat<std::uint8_t>(bytes, normalized);
    case Component::kInt16:
      return ToFloat<std::int16_t>(bytes, normalized);
    case Component::kUint16:
      return ToFloat<std::uint16_t>(bytes, normalized);
    case Component::kUint32:
      return ToFloat<std::uint32_t>(bytes, normalized);
    case Component::kFloat:
      break;
  }
  return ToFloat<float>(bytes, false);
}

std::uint32_t ReadUnsigned(Component component, const char* bytes) {
  switch (component) {
    case Component::kUint8:
      return Load<std::uint8_t>(bytes);
    case Component::kUint16:
      return Load<std::uint16_t>(bytes);
    default:
      return Load<std::uint32_t>(bytes);
  }
}

/// Where element `i` stands, or nullptr for one that is all zeros.
const char* Locate(const Accessor& accessor, std::size_t i) {
  if (accessor.sparse) {
    const Sparse& sparse = *accessor.sparse;
    std::size_t low = 0;
    std::size_t high = sparse.count;
    while (low < high) {
      const std::size_t middle = low + (high - low) / 2;
      if (ReadSparseIndex(sparse, middle) < i) {
        low = middle + 1;
      } else {
        high = middle;
      }
    }
    if (low < sparse.count && ReadSparseIndex(sparse, low) == i) {
      return sparse.values.data() + low * accessor.columns * accessor.column_stride;
    }
  }
  return accessor.bytes.empty() ? nullptr : accessor.bytes.data() + i * accessor.stride;
}

}  // namespace

std::size_t ReadSparseIndex(const Sparse& sparse, std::size_t i) {
  return ReadUnsigned(sparse.index_component, sparse.indices.data() + i * SizeOf(sparse.index_component));
}

void ReadElement(const Accessor& accessor, std::size_t i, float* element) {
  const char* bytes = Locate(accessor, i);
  if (bytes == nullptr) {
    std::fill_n(element, accessor.Width(), 0.0F);
    return;
  }
  const std::size_t size = SizeOf(accessor.component);
  for (std::size_t column = 0; column < accessor.columns; ++column) {
    for (std::size_t row = 0; row < accessor.rows; ++row) {
      *element++ = ReadComponent(accessor.component, bytes + column * accessor.column_stride + row * size,
                                 accessor.normalized);
    }
  }
}

std::uint32_t ReadIndex(const Accessor& accessor, std::size_t i) {
  const char* bytes = Locate(accessor, i);
  return bytes == nullptr ? 0 : ReadUnsigned(accessor.component, bytes);
}

}  // namespace radbake::gltf
