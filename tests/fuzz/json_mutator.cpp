// How libFuzzer varies JSON, alone or with bytes behind a zero byte: mostly by its values and not by its
// letters, so that most of what comes out is JSON still and gets past the parser.
#include <algorithm>
#include <array>
#include <cstdint>
#include <iterator>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "tests/fuzz/fuzz.h"

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t most);  // NOLINT

namespace {

using nlohmann::json;
using Random = std::minstd_rand;

const std::vector<json> kValues = {0,
                                   1,
                                   2,
                                   3,
                                   4,
                                   5,
                                   -1,
                                   0.5,
                                   5121,
                                   5123,
                                   5125,
                                   5126,
                                   65535,
                                   65536,
                                   1e308,
                                   1e-308,
                                   4294967295,
                                   INT64_MAX,
                                   UINT64_MAX,
                                   nullptr,
                                   true,
                                   false,
                                   "",
                                   "2.0",
                                   "SCALAR",
                                   "VEC2",
                                   "VEC3",
                                   "VEC4",
                                   "MAT4",
                                   "OPAQUE",
                                   "MASK",
                                   "spot",
                                   "point",
                                   "directional",
                                   "auto",
                                   "beside.bin",
                                   "data:;base64,AAAA",
                                   json::array(),
                                   json::object(),
                                   json::array({0, 0, 0})};

void Collect(json& node, std::vector<json*>& nodes) {
  nodes.push_back(&node);
  if (node.is_structured()) {
    for (json& child : node) {
      Collect(child, nodes);
    }
  }
}

void Erase(json& node, Random& random) {
  if (node.is_structured() && !node.empty()) {
    auto at = node.begin();
    std::advance(at, static_cast<std::ptrdiff_t>(random() % node.size()));
    node.erase(at);
  }
}

void Grow(json& node, const json& other, Random& random) {
  if (node.is_array()) {
    node.push_back(node.empty() || random() % 2 == 0 ? other : json(node[random() % node.size()]));
  } else if (node.is_object() && other.is_object() && !other.empty()) {
    auto at = other.begin();
    std::advance(at, static_cast<std::ptrdiff_t>(random() % other.size()));
    node[at.key()] = at.value();
  }
}

void Nudge(json& node, Random& random) {
  if (node.is_number_integer()) {
    const auto step = static_cast<std::int64_t>(random() % 5) - 2;
    node = static_cast<std::int64_t>(node.get<std::uint64_t>() + static_cast<std::uint64_t>(step));
  } else if (node.is_number()) {
    node = node.get<double>() * std::array<double, 4>{-1, 2, 1e-3, 1e6}.at(random() % 4);
  }
}

void Change(json& root, Random& random) {
  std::vector<json*> nodes;
  Collect(root, nodes);
  json& node = *nodes[random() % nodes.size()];
  const json other = *nodes[random() % nodes.size()];
  switch (random() % 6) {
    case 0:
      node = kValues[random() % kValues.size()];
      break;
    case 1:
      node = other;
      break;
    case 2:
      Erase(node, random);
      break;
    case 3:
      Grow(node, other, random);
      break;
    default:
      Nudge(node, random);
  }
}

}  // namespace

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size,
                                               std::size_t most,  // NOLINT
                                               unsigned seed) {
  Random random(seed + 1);
  const std::string_view input = radbake::fuzz::Text(data, size);
  const std::size_t end = std::min(input.find('\0'), size);
  json root =
      random() % 8 == 0 ? json(json::value_t::discarded) : json::parse(input.substr(0, end), nullptr, false);
  if (root.is_discarded()) {
    return LLVMFuzzerMutate(data, size, most);
  }
  std::string rest(input.substr(end));
  if (rest.size() > 1 && random() % 4 == 0) {
    const std::size_t before = rest.size();
    rest.resize(before + 64);
    rest.resize(
        1 + LLVMFuzzerMutate(reinterpret_cast<std::uint8_t*>(rest.data()) + 1, before - 1, rest.size() - 1));
  } else {
    for (std::size_t times = 1 + random() % 3; times > 0; --times) {
      Change(root, random);
    }
  }
  const std::string made = root.dump(-1, ' ', false, json::error_handler_t::replace) + rest;
  if (made.size() > most) {
    return LLVMFuzzerMutate(data, size, most);
  }
  std::copy(made.begin(), made.end(), data);
  return made.size();
}
