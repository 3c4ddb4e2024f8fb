#include "solver/parameters.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace radbake {
namespace {

using Json = nlohmann::json;

constexpr std::size_t kMaxKib = 64;
constexpr int kMaxDepth = 8;
constexpr std::size_t kMaxProbes = 1'000'000;
constexpr double kMaxSeconds = 1e6;

template <typename Value>
using Words = std::span<const std::pair<std::string_view, Value>>;
constexpr std::array kMethods{std::pair{std::string_view{"matrix"}, Method::kMatrix},
                              std::pair{std::string_view{"two-level"}, Method::kTwoLevel},
                              std::pair{std::string_view{"hierarchical"}, Method::kHierarchical},
                              std::pair{std::string_view{"adaptive"}, Method::kAdaptive}};
using OptionalBasis = std::optional<BasisOrder>;
constexpr std::array kBases{std::pair{std::string_view{"auto"}, OptionalBasis{}},
                            std::pair{std::string_view{"constant"}, OptionalBasis{BasisOrder::kConstant}},
                            std::pair{std::string_view{"linear"}, OptionalBasis{BasisOrder::kLinear}},
                            std::pair{std::string_view{"quadratic"}, OptionalBasis{BasisOrder::kQuadratic}}};
constexpr std::array kClusterings{std::pair{std::string_view{"auto"}, Clustering::kAuto},
                                  std::pair{std::string_view{"on"}, Clustering::kOn},
                                  std::pair{std::string_view{"off"}, Clustering::kOff}};
constexpr std::array kFinalGathers{std::pair{std::string_view{"auto"}, FinalGather::kAuto},
                                   std::pair{std::string_view{"on"}, FinalGather::kOn},
                                   std::pair{std::string_view{"off"}, FinalGather::kOff}};

template <typename Value>
bool ReadWord(const Json& value, Words<Value> words, Value& out) {
  if (!value.is_string()) {
    return false;
  }
  const auto* const found =
      std::ranges::find(words.data(), words.data() + words.size(), value.get_ref<const std::string&>(),
                        &std::pair<std::string_view, Value>::first);
  if (found == words.data() + words.size()) {
    return false;
  }
  out = found->second;
  return true;
}

template <typename Value>
Json WriteWord(Words<Value> words, Value value) {
  return std::ranges::find(words, value, &std::pair<std::string_view, Value>::second)->first;
}

/// A number in [low, high].
template <typename Number>
bool ReadNumber(const Json& value, double low, double high, Number& out) {
  if (!value.is_number()) {
    return false;
  }
  const auto number = value.get<double>();
  if (number < low || number > high) {
    return false;
  }
  out = number;
  return true;
}

Json WriteOptional(const std::optional<double>& value) {
  return value ? Json(*value) : Json();
}

/// A share above 0 and below 1, or null for the bake's own choice.
bool ReadShare(const Json& value, std::optional<double>& out) {
  if (value.is_null()) {
    out.reset();
    return true;
  }
  return ReadNumber(value, std::numeric_limits<double>::min(), std::nextafter(1.0, 0.0), out);
}

bool ReadRadiance(const Json& value, Rgb& out) {
  constexpr double kBrightest = 1e18;
  std::array<double, 3> channels{};
  if (!value.is_array() || value.size() != channels.size()) {
    return false;
  }
  for (std::size_t i = 0; i < channels.size(); ++i) {
    if (!ReadNumber(value[i], 0, kBrightest, channels[i])) {
      return false;
    }
  }
  out = Rgb(channels[0], channels[1], channels[2]);
  return true;
}

bool ReadNothing(const Json&, Parameters&) {
  return false;
}
Json WriteNothing(const Parameters&) {
  return {};
}

constexpr std::string_view kShare = "a number above 0 and below 1, or null for one that follows from error";
constexpr std::string_view kNoImages = "no value yet (it belongs to lightmap and texture output)";

constexpr std::array kSpecs{
    ParameterSpec{"error", "a number from 0.001 to 0.5",
                  "target: relative RMS error of the irradiance over the baked surface",
                  [](const Json& value, Parameters& p) { return ReadNumber(value, 0.001, 0.5, p.error); },
                  [](const Parameters& p) { return Json(p.error); }},
    ParameterSpec{"time_budget", "seconds above 0 and up to 1,000,000, or null for none",
                  "stop refining then, and give the best result so far",
                  [](const Json& value, Parameters& p) {
                    if (value.is_null()) {
                      p.time_budget.reset();
                      return true;
                    }
                    return ReadNumber(value, std::numeric_limits<double>::min(), kMaxSeconds, p.time_budget);
                  },
                  [](const Parameters& p) { return WriteOptional(p.time_budget); }},
    ParameterSpec{
        "method", "matrix, two-level, hierarchical or adaptive",
        "which nodes are linked: every two leaves, patches to elements, by form factor, or by energy",
        [](const Json& value, Parameters& p) { return ReadWord<Method>(value, kMethods, p.method); },
        [](const Parameters& p) { return WriteWord<Method>(kMethods, p.method); }},
    ParameterSpec{
        "basis", "auto, constant, linear or quadratic",
        "order of the basis: what the solution is over an element; auto: linear where adaptive links "
        "patches, else constant",
        [](const Json& value, Parameters& p) { return ReadWord<OptionalBasis>(value, kBases, p.basis); },
        [](const Parameters& p) { return WriteWord<OptionalBasis>(kBases, p.basis); }},
    ParameterSpec{"clustering", "auto, on or off",
                  "clusters above patches; auto: where there are many patches",
                  [](const Json& value, Parameters& p) {
                    return ReadWord<Clustering>(value, kClusterings, p.clustering);
                  },
                  [](const Parameters& p) { return WriteWord<Clustering>(kClusterings, p.clustering); }},
    ParameterSpec{"final_gather", "auto, on or off", "the output's irradiance gathered anew at each vertex",
                  [](const Json& value, Parameters& p) {
                    return ReadWord<FinalGather>(value, kFinalGathers, p.final_gather);
                  },
                  [](const Parameters& p) { return WriteWord<FinalGather>(kFinalGathers, p.final_gather); }},
    ParameterSpec{"output.kind", "vertex", "how the result is stored",
                  [](const Json& value, Parameters&) { return value == "vertex"; },
                  [](const Parameters&) { return Json("vertex"); }},
    ParameterSpec{"output.exposure", "auto or a number above 0", "radiance × exposure = displayed value 1",
                  [](const Json& value, Parameters& p) {
                    if (value == "auto") {
                      p.exposure.reset();
                      return true;
                    }
                    return ReadNumber(value, std::numeric_limits<double>::min(),
                                      std::numeric_limits<double>::max(), p.exposure);
                  },
                  [](const Parameters& p) { return p.exposure ? Json(*p.exposure) : Json("auto"); }},
    ParameterSpec{"output.texel_size", kNoImages, "metres", ReadNothing, WriteNothing},
    ParameterSpec{"output.max_size", kNoImages, "texels", ReadNothing, WriteNothing},
    ParameterSpec{"environment.radiance", "[red, green, blue], each a number from 0 to 1e18",
                  "a uniform sky, in cd/m²",
                  [](const Json& value, Parameters& p) { return ReadRadiance(value, p.environment); },
                  [](const Parameters& p) { return Json(std::span(p.environment.data(), 3)); }},
    ParameterSpec{"oracle.a_min", kShare,
                  "elements smaller than this share of the scene's area are not divided",
                  [](const Json& value, Parameters& p) { return ReadShare(value, p.oracle.a_min); },
                  [](const Parameters& p) { return WriteOptional(p.oracle.a_min); }},
    ParameterSpec{"oracle.f_max", kShare,
                  "hierarchical: the largest form factor of a link between divisible elements",
                  [](const Json& value, Parameters& p) { return ReadShare(value, p.oracle.f_max); },
                  [](const Parameters& p) { return WriteOptional(p.oracle.f_max); }},
    ParameterSpec{"oracle.w_min", kShare,
                  "adaptive: the largest uncertainty of a link's power, as a share of the emitted",
                  [](const Json& value, Parameters& p) { return ReadShare(value, p.oracle.w_min); },
                  [](const Parameters& p) { return WriteOptional(p.oracle.w_min); }},
    ParameterSpec{"check", "an integer from 0 to 1,000,000",
                  "how many path-traced probes measure the result's error; 0: none",
                  [](const Json& value, Parameters& p) {
                    if (!value.is_number_unsigned() || value.get<std::size_t>() > kMaxProbes) {
                      return false;
                    }
                    p.check = value.get<std::size_t>();
                    return true;
                  },
                  [](const Parameters& p) { return Json(p.check); }},
};

/// A value or key as a message may hold it: one line of ASCII, not long.
std::string Quoted(const Json& value) {
  constexpr std::size_t kLongest = 60;
  std::string text = value.dump(-1, ' ', true, Json::error_handler_t::replace);
  if (text.size() > kLongest) {
    text.resize(kLongest);
    text += "…";
  }
  return text;
}

/// nlohmann's parser keeps the last of two equal keys and nests without end; both are refused while it
/// parses.
class Guard {
 public:
  bool operator()(int depth, Json::parse_event_t event, const Json& parsed) {
    switch (event) {
      case Json::parse_event_t::object_start:
        keys_.emplace_back();
        [[fallthrough]];
      case Json::parse_event_t::array_start:
        if (depth >= kMaxDepth) {
          throw InputError("parameters: nested deeper than " + std::to_string(kMaxDepth));
        }
        break;
      case Json::parse_event_t::object_end:
        keys_.pop_back();
        break;
      case Json::parse_event_t::key:
        if (!keys_.back().insert(parsed.get<std::string>()).second) {
          throw InputError("parameters: the key " + Quoted(parsed) + " is there twice");
        }
        break;
      default:
        break;
    }
    return true;
  }

 private:
  std::vector<std::set<std::string>> keys_;
};

/// The place that the parser's message names; the rest of it may quote bytes that are not UTF-8.
std::string Place(const Json::parse_error& error) {
  const std::string_view message = error.what();
  const std::size_t begin = message.find("at line ");
  if (begin == std::string_view::npos) {
    return "at byte " + std::to_string(error.byte);
  }
  return std::string(message.substr(begin, message.find(':', begin) - begin));
}

Json ParseGuarded(std::string_view text) {
  if (text.size() > kMaxKib * 1024) {
    throw InputError("parameters: longer than " + std::to_string(kMaxKib) + " KiB");
  }
  try {
    return Json::parse(text,
                       [guard = Guard()](int depth, Json::parse_event_t event, const Json& parsed) mutable {
                         return guard(depth, event, parsed);
                       });
  } catch (const Json::parse_error& error) {
    throw InputError("parameters: not JSON " + Place(error));
  } catch (const Json::out_of_range&) {
    throw InputError("parameters: a number is out of range");
  }
}

void Set(const ParameterSpec& spec, const Json& value, Parameters& parameters) {
  if (!spec.read(value, parameters)) {
    throw InputError("parameters: " + std::string(spec.key) + " takes " + std::string(spec.takes) + ", not " +
                     Quoted(value));
  }
}

[[noreturn]] void ThrowUnknown(const std::string& key) {
  std::string message = "parameters: unknown key " + Quoted(key) + "; the keys are ";
  for (const ParameterSpec& spec : kSpecs) {
    message += spec.key;
    message += &spec == &kSpecs.back() ? " (a dot is one object in another)" : ", ";
  }
  throw InputError(message);
}

bool IsGroup(std::string_view key) {
  return std::ranges::any_of(kSpecs, [&](const ParameterSpec& spec) {
    return spec.key.size() > key.size() && spec.key.starts_with(key) && spec.key[key.size()] == '.';
  });
}

void SetAll(const std::string& prefix, const Json& object, Parameters& parameters) {
  for (const auto& [name, value] : object.items()) {
    const std::string key = prefix + name;
    const auto* const spec = std::ranges::find(kSpecs, std::string_view(key), &ParameterSpec::key);
    if (name.find('.') != std::string::npos || (spec == kSpecs.end() && !IsGroup(key))) {
      ThrowUnknown(key);
    }
    if (spec != kSpecs.end()) {
      Set(*spec, value, parameters);
    } else if (value.is_object()) {
      SetAll(key + ".", value, parameters);
    } else {
      throw InputError("parameters: " + key + " takes an object, not " + Quoted(value));
    }
  }
}

}  // namespace

std::span<const ParameterSpec> ParameterSpecs() {
  return kSpecs;
}

Parameters ParseParameters(std::string_view json) {
  const Json object = ParseGuarded(json);
  if (!object.is_object()) {
    throw InputError("parameters: takes a JSON object, not " + Quoted(object));
  }
  Parameters parameters;
  SetAll("", object, parameters);
  return parameters;
}

void SetParameter(std::string_view key, std::string_view text, Parameters& parameters) {
  const auto* const spec = std::ranges::find(kSpecs, key, &ParameterSpec::key);
  if (spec == kSpecs.end()) {
    ThrowUnknown(std::string(key));
  }
  Set(*spec, Json::accept(text) ? ParseGuarded(text) : Json(text), parameters);
}

nlohmann::ordered_json ToJson(const Parameters& parameters) {
  nlohmann::ordered_json json;
  for (const ParameterSpec& spec : kSpecs) {
    if (spec.read == ReadNothing) {
      continue;
    }
    std::string pointer = "/" + std::string(spec.key);
    std::ranges::replace(pointer, '.', '/');
    json[nlohmann::ordered_json::json_pointer(pointer)] = spec.write(parameters);
  }
  return json;
}

}  // namespace radbake
