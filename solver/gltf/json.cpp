#include "solver/gltf/json.h"

#include <set>

#include "solver/scene/types.h"

namespace radbake::gltf {

std::string ToString(const Place& place) {
  std::string text(place.kind);
  if (place.index != Place::kWhole) {
    text += ' ' + std::to_string(place.index);
  }
  if (!place.part.empty()) {
    text += ' ' + std::string(place.part);
  }
  if (place.part_index != Place::kWhole) {
    text += ' ' + std::to_string(place.part_index);
  }
  return text;
}

std::string_view Singular(std::string_view list) {
  return list.ends_with("meshes") ? "mesh" : list.substr(0, list.size() - (list.ends_with('s') ? 1 : 0));
}

void Fail(const Place& place, std::string_view message) {
  throw InputError(ToString(place) + ": " + std::string(message));
}

std::string Quoted(std::string_view text) {
  constexpr std::size_t kLongest = 80;
  std::string quoted = "'";
  bool cut = false;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    // Cut between characters of UTF-8, never inside one.
    if (quoted.size() > kLongest && (byte & 0xC0U) != 0x80U) {
      cut = true;
      break;
    }
    quoted += byte < 0x20 || byte == 0x7F ? ' ' : c;
  }
  return quoted + (cut ? "…'" : "'");
}

namespace {

/// Looks through JSON before a document is made of it. (The parser's own callback for that walks a list again
/// after each of its elements: a list of a million would take minutes.)
class Inspector : public nlohmann::json_sax<Json> {
 public:
  explicit Inspector(std::size_t depth) : depth_(depth) {}

  bool null() override { return true; }
  bool boolean(bool /*value*/) override { return true; }
  bool number_integer(number_integer_t /*value*/) override { return true; }
  bool number_unsigned(number_unsigned_t /*value*/) override { return true; }
  bool number_float(number_float_t /*value*/, const string_t& /*text*/) override { return true; }
  bool string(string_t& /*value*/) override { return true; }
  bool binary(binary_t& /*value*/) override { return true; }
  bool start_object(std::size_t /*size*/) override { return Open(); }
  bool key(string_t& name) override {
    if (!members_.back().insert(name).second) {
      throw InputError("JSON: member " + Quoted(name) + " is twice in one object");
    }
    return true;
  }
  bool end_object() override { return Close(); }
  bool start_array(std::size_t /*size*/) override { return Open(); }
  bool end_array() override { return Close(); }
  bool parse_error(std::size_t /*position*/, const std::string& /*token*/,
                   const nlohmann::detail::exception& /*error*/) override {
    return false;  // the parser of the document says it better
  }

 private:
  bool Open() {
    if (members_.size() >= depth_) {
      throw InputError("JSON: nested deeper than " + std::to_string(depth_) + " levels");
    }
    members_.emplace_back();
    return true;
  }
  bool Close() {
    members_.pop_back();
    return true;
  }

  std::size_t depth_;
  std::vector<std::set<std::string>> members_;  ///< of the objects and arrays that are open
};

}  // namespace

Json ParseJson(std::string_view text, std::size_t depth) {
  Inspector inspector(depth);
  Json::sax_parse(text, &inspector);
  try {
    Json root = Json::parse(text);
    if (!root.is_object()) {
      throw InputError("JSON: not an object");
    }
    return root;
  } catch (const Json::exception& error) {
    // "[json.exception.parse_error.101] parse error at line …": what matters comes after the bracket.
    const std::string_view what = error.what();
    const std::size_t bracket = what.find("] ");
    const std::string_view plain = bracket == std::string_view::npos ? what : what.substr(bracket + 2);
    std::string line;
    for (const char c : plain.substr(0, 200)) {
      const auto byte = static_cast<unsigned char>(c);
      line += byte < 0x20 || byte >= 0x7F ? '?' : c;
    }
    throw InputError("JSON: " + line);
  }
}

const Json* Find(const Json& object, const char* key) {
  const auto found = object.find(key);
  return found == object.end() ? nullptr : &*found;
}

Json* Find(Json& object, const char* key) {
  const auto found = object.find(key);
  return found == object.end() ? nullptr : &*found;
}

const Json* FindObject(const Json& object, const char* key, const Place& place) {
  const Json* member = Find(object, key);
  if (member != nullptr && !member->is_object()) {
    Fail(place, std::string(key) + " is not an object");
  }
  return member;
}

const Json& Objects(const Json& object, const char* key, const Place& place) {
  static const Json kEmpty = Json::array();
  const Json* member = Find(object, key);
  if (member == nullptr) {
    return kEmpty;
  }
  if (!member->is_array()) {
    Fail(place, std::string(key) + " is not a list");
  }
  for (const Json& element : *member) {
    if (!element.is_object()) {
      Fail(place, std::string(key) + " holds something that is not an object");
    }
  }
  return *member;
}

namespace {

std::size_t AsCount(const Json& value, const char* key, const Place& place) {
  if (!value.is_number_unsigned()) {
    Fail(place, std::string(key) + " is not a whole number from 0 up");
  }
  return value.get<std::size_t>();
}

std::size_t AsIndex(const Json& value, const char* key, std::size_t size, const Place& place) {
  const std::size_t index = AsCount(value, key, place);
  if (index >= size) {
    Fail(place, std::string(key) + " " + std::to_string(index) + " is beyond the " + std::to_string(size) +
                    " that there are");
  }
  return index;
}

}  // namespace

std::optional<std::size_t> FindCount(const Json& object, const char* key, const Place& place) {
  const Json* member = Find(object, key);
  return member == nullptr ? std::nullopt : std::optional(AsCount(*member, key, place));
}

std::size_t Count(const Json& object, const char* key, const Place& place) {
  const std::optional<std::size_t> count = FindCount(object, key, place);
  if (!count) {
    Fail(place, std::string(key) + " is missing");
  }
  return *count;
}

std::optional<std::size_t> FindIndex(const Json& object, const char* key, std::size_t size,
                                     const Place& place) {
  const Json* member = Find(object, key);
  return member == nullptr ? std::nullopt : std::optional(AsIndex(*member, key, size, place));
}

std::vector<std::size_t> Indices(const Json& object, const char* key, std::size_t size, const Place& place) {
  std::vector<std::size_t> indices;
  const Json* member = Find(object, key);
  if (member == nullptr) {
    return indices;
  }
  if (!member->is_array()) {
    Fail(place, std::string(key) + " is not a list");
  }
  std::set<std::size_t> seen;
  for (const Json& value : *member) {
    indices.push_back(AsIndex(value, key, size, place));
    if (!seen.insert(indices.back()).second) {
      Fail(place, std::string(key) + " names " + std::to_string(indices.back()) + " twice");
    }
  }
  return indices;
}

double Number(const Json& object, const char* key, double otherwise, const Place& place) {
  const Json* member = Find(object, key);
  if (member != nullptr && !member->is_number()) {
    Fail(place, std::string(key) + " is not a number");
  }
  return member == nullptr ? otherwise : member->get<double>();
}

bool Flag(const Json& object, const char* key, bool otherwise, const Place& place) {
  const Json* member = Find(object, key);
  if (member != nullptr && !member->is_boolean()) {
    Fail(place, std::string(key) + " is neither true nor false");
  }
  return member == nullptr ? otherwise : member->get<bool>();
}

std::string Text(const Json& object, const char* key, std::string_view otherwise, const Place& place) {
  const Json* member = Find(object, key);
  if (member != nullptr && !member->is_string()) {
    Fail(place, std::string(key) + " is not a text");
  }
  return member == nullptr ? std::string(otherwise) : member->get<std::string>();
}

namespace {

void CheckExtensions(const Json& value, const Place& place) {
  if (value.is_object()) {
    FindObject(value, "extensions", place);
  }
  for (const auto& [key, member] : value.items()) {
    if (member.is_structured() && key != "extensions" && key != "extras") {
      CheckExtensions(member, place);
    }
  }
}

}  // namespace

void CheckExtensions(const Json& root) {
  FindObject(root, "extensions", {"glTF"});
  for (const auto& [list, elements] : root.items()) {
    if (list == "extensions" || list == "extras") {
      continue;
    }
    for (std::size_t i = 0; elements.is_array() && i < elements.size(); ++i) {
      CheckExtensions(elements[i], {Singular(list), i});
    }
    if (elements.is_object()) {
      CheckExtensions(elements, {list});
    }
  }
}

const Json* FindExtension(const Json& object, const char* name, const Place& place) {
  const Json* extensions = FindObject(object, "extensions", place);
  return extensions == nullptr ? nullptr : FindObject(*extensions, name, place);
}

}  // namespace radbake::gltf
