/// How many bytes of memory containers hold, and who is told.
#pragma once

#include <cstddef>
#include <functional>
#include <unordered_map>
#include <vector>

namespace radbake {

/// Told how many bytes a step of the bake holds, or will before it is asked again; throws to end it instead.
/// The same numbers on any number of threads.
using Hold = std::function<void(std::size_t bytes)>;

template <typename T>
std::size_t BytesOf(const std::vector<T>& vector) {
  return vector.capacity() * sizeof(T);
}

/// Each entry is a node of its own: a pointer to the next, itself, and what malloc keeps.
template <typename Key, typename Value>
std::size_t BytesOf(const std::unordered_map<Key, Value>& map) {
  constexpr std::size_t kNode = sizeof(void*) + sizeof(std::pair<const Key, Value>) + sizeof(std::size_t);
  return kNode * map.size() + sizeof(void*) * map.bucket_count();
}

}  // namespace radbake
