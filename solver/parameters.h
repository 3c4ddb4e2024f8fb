/// The parameters of a bake: the same JSON for the command line and the service (DESIGN section 2).
#pragma once

#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>

namespace radbake {

enum class Method { kHierarchical, kAdaptive };

/// How the irradiance of the output is made. kOff: averages of the elements' own; kOn, kAuto: gathered anew at
/// each vertex from the links of the hierarchy.
enum class FinalGather { kAuto, kOn, kOff };

struct OracleParameters {
  /// Elements smaller than this share of the scene's area are not divided.
  std::optional<double> a_min;
  /// `hierarchical`: the largest form factor that a link between divisible elements may have.
  std::optional<double> f_max;
  /// `adaptive`: the largest uncertainty of a link's transported power, as a share of the emitted power.
  std::optional<double> w_min;
};

struct Parameters {
  double error = 0.02;                 ///< 0.001 to 0.5: target of the relative RMS error
  std::optional<double> time_budget;   ///< seconds, above 0
  Method method = Method::kAdaptive;
  FinalGather final_gather = FinalGather::kAuto;
  std::optional<double> exposure;      ///< nothing: auto
  OracleParameters oracle;             ///< nothing: from `error`
  std::size_t check = 256;             ///< probes, 0 to 1,000,000; 0: no check
};

/// Parses and validates. Throws InputError that names the key and what it takes: an unknown key, a wrong type, a
/// value out of range or one that is not built yet, bad JSON, a duplicate key, nesting deeper than the contract's.
Parameters ParseParameters(std::string_view json);

/// The same keys, resolved: what the statistics show.
nlohmann::json ToJson(const Parameters& parameters);

}  // namespace radbake
