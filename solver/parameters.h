/// The parameters of a bake: the same JSON for the command line and the service (DESIGN section 2).
#pragma once

#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string_view>

#include "solver/hierarchy/basis_order.h"
#include "solver/scene/types.h"

namespace radbake {

enum class Method { kMatrix, kTwoLevel, kHierarchical, kAdaptive };

/// Whether the patches hang below clusters. kAuto: where there are so many that linking each to each costs
/// more.
enum class Clustering { kAuto, kOn, kOff };

/// Whether the output's irradiance is gathered anew at each vertex from the links of the hierarchy. It always
/// is so far: kAuto is kOn.
enum class FinalGather { kAuto, kOn, kOff };

struct OracleParameters {
  /// Elements smaller than this share of the scene's area are not divided.
  std::optional<double> a_min;
  /// `hierarchical`: the largest form factor that a link between divisible elements may have.
  std::optional<double> f_max;
  /// `adaptive`: the largest uncertainty of a link's transported power, as a share of the power that the
  /// surfaces absorb (all that is emitted, in a closed room).
  std::optional<double> w_min;
};

struct Parameters {
  double error = 0.02;                ///< 0.001 to 0.5: target of the relative RMS error
  std::optional<double> time_budget;  ///< seconds, above 0
  Method method = Method::kAdaptive;
  std::optional<BasisOrder> basis;  ///< nothing: the method's own, see BasisOf
  Clustering clustering = Clustering::kAuto;
  FinalGather final_gather = FinalGather::kAuto;
  std::optional<double> exposure;  ///< nothing: auto
  Rgb environment = Rgb::Zero();   ///< radiance of a uniform sky in cd/m², 0 to 1e18
  OracleParameters oracle;         ///< nothing: from `error`
  std::size_t check = 256;         ///< probes, 0 to 1,000,000; 0: no check
};

/// One key of the contract's table, the only description of it: JSON, flags, help and errors come from here.
struct ParameterSpec {
  std::string_view key;    ///< dotted where the JSON nests: "output.kind" is {"output": {"kind": …}}
  std::string_view takes;  ///< the values it takes, for messages: "a number from 0.001 to 0.5"
  std::string_view means;  ///< one line of help
  /// Stores the value; false (and nothing stored) if it is not one that the key takes.
  bool (*read)(const nlohmann::json& value, Parameters& parameters);
  /// The value, resolved; null where the bake chooses or there is none.
  nlohmann::json (*write)(const Parameters& parameters);
};

/// Every key, in the order of the contract's table.
std::span<const ParameterSpec> ParameterSpecs();

/// Parses and validates a JSON object of at most 64 KiB; a key that is absent keeps its default. Throws
/// InputError of one line that names the key and what it takes: an unknown or a duplicate key, a wrong type,
/// a value out of range or one that is not built yet, text that is not JSON, nesting deeper than eight.
Parameters ParseParameters(std::string_view json);

/// Sets one key from a flag's text: JSON, or a bare word for a string (`adaptive`). Throws InputError as
/// above.
void SetParameter(std::string_view key, std::string_view text, Parameters& parameters);

/// The same keys, resolved: what the statistics show. ParseParameters takes it back.
nlohmann::ordered_json ToJson(const Parameters& parameters);

}  // namespace radbake
