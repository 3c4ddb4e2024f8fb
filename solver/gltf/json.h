/// The JSON of a glTF, read with distrust: parsed within a depth, and asked for typed members with the place
/// named.
#pragma once

#include <array>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace radbake::gltf {

using Json = nlohmann::json;

/// Where something is in a glTF, for messages: "accessor 3", "mesh 2 primitive 0".
struct Place {
  static constexpr std::size_t kWhole = SIZE_MAX;
  std::string_view kind;
  std::size_t index = kWhole;
  std::string_view part = {};
  std::size_t part_index = kWhole;
};
std::string ToString(const Place& place);

/// What an element of a list of a glTF is called: "mesh" of "meshes".
std::string_view Singular(std::string_view list);

/// Throws InputError "place: message".
[[noreturn]] void Fail(const Place& place, std::string_view message);

/// Text of the input as it may stand in a one-line message: in quotes, without control characters, cut if
/// long.
std::string Quoted(std::string_view text);

/// Parses a JSON object. Throws InputError for bad syntax or UTF-8, nesting deeper than `depth`, and an
/// object with the same member twice, of which two readers would take different ones.
Json ParseJson(std::string_view text, std::size_t depth);

/// The member, or nullptr. `object` must be an object.
const Json* Find(const Json& object, const char* key);
Json* Find(Json& object, const char* key);

/// The member as an object or nullptr. Throws InputError where it is of another type; so do all below.
const Json* FindObject(const Json& object, const char* key, const Place& place);

/// The member as an array of objects; an empty array where it is not there.
const Json& Objects(const Json& object, const char* key, const Place& place);

/// The member as a whole number that is not negative.
std::optional<std::size_t> FindCount(const Json& object, const char* key, const Place& place);
std::size_t Count(const Json& object, const char* key, const Place& place);

/// The member as an index below `size`.
std::optional<std::size_t> FindIndex(const Json& object, const char* key, std::size_t size,
                                     const Place& place);

/// A list of distinct indices below `size`; empty where it is not there.
std::vector<std::size_t> Indices(const Json& object, const char* key, std::size_t size, const Place& place);

double Number(const Json& object, const char* key, double otherwise, const Place& place);
bool Flag(const Json& object, const char* key, bool otherwise, const Place& place);
std::string Text(const Json& object, const char* key, std::string_view otherwise, const Place& place);

/// Exactly N numbers, or nothing.
template <std::size_t N>
std::optional<std::array<double, N>> FindNumbers(const Json& object, const char* key, const Place& place) {
  const Json* member = Find(object, key);
  if (member == nullptr) {
    return std::nullopt;
  }
  std::array<double, N> numbers{};
  if (!member->is_array() || member->size() != N) {
    Fail(place, std::string(key) + " is not a list of " + std::to_string(N) + " numbers");
  }
  for (std::size_t i = 0; i < N; ++i) {
    if (!(*member)[i].is_number()) {
      Fail(place, std::string(key) + " is not a list of " + std::to_string(N) + " numbers");
    }
    numbers[i] = (*member)[i].get<double>();
  }
  return numbers;
}

/// Throws InputError where `extensions` of the document, of one of its elements or of a part of one is not an
/// object. What lies within extensions and extras is theirs.
void CheckExtensions(const Json& root);

/// The named extension of an object, or nullptr.
const Json* FindExtension(const Json& object, const char* name, const Place& place);

}  // namespace radbake::gltf
