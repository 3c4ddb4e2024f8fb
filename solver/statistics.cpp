#include "solver/statistics.h"

#include <nlohmann/json.hpp>

namespace radbake {
namespace {

using Json = nlohmann::ordered_json;

Json ToJson(const Rgb& rgb) {
  return Json::array({rgb[0], rgb[1], rgb[2]});
}

Json ToJson(StoppedBy stopped_by) {
  switch (stopped_by) {
    case StoppedBy::kError:
      return "error";
    case StoppedBy::kTimeBudget:
      return "time_budget";
    case StoppedBy::kLimit:
      return "limit";
  }
  return nullptr;
}

Json ToJson(const EnergyBalance& energy) {
  return {{"emitted", ToJson(energy.emitted)},
          {"absorbed", ToJson(energy.absorbed)},
          {"absorbed_by_backs", ToJson(energy.absorbed_by_backs)},
          {"escaped", ToJson(energy.escaped)},
          {"imbalance", energy.imbalance}};
}

Json MemoryToJson(const Statistics& statistics) {
  const auto per = [](std::size_t bytes, std::size_t count) {
    return count > 0 ? static_cast<double>(bytes) / static_cast<double>(count) : 0;
  };
  const Iteration last = statistics.iterations.empty() ? Iteration() : statistics.iterations.back();
  return {{"limit_bytes", statistics.memory_limit},
          {"peak_bytes", statistics.peak_bytes},
          {"bytes_per_element", per(statistics.solve_bytes.elements, last.elements)},
          {"bytes_per_link", per(statistics.solve_bytes.links, last.links)}};
}

Json TimeToJson(const std::vector<std::pair<std::string, double>>& seconds) {
  Json json = Json::object();
  double total = 0;
  for (const auto& [phase, duration] : seconds) {
    json[phase] = duration;
    total += duration;
  }
  json["total"] = total;
  return json;
}

}  // namespace

nlohmann::ordered_json ToJson(const Iteration& iteration) {
  return {{"pass", iteration.pass},         {"sweeps", iteration.sweeps},  {"residual", iteration.residual},
          {"elements", iteration.elements}, {"links", iteration.links},    {"factors", iteration.factors},
          {"rays", iteration.rays},         {"seconds", iteration.seconds}};
}

nlohmann::ordered_json ToJson(const CheckSummary& summary) {
  return {{"relative_rms", summary.error},
          {"low", summary.error_low},
          {"high", summary.error_high},
          {"bias", summary.bias},
          {"bias_interval", summary.bias_interval},
          {"missing", summary.missing},
          {"probes", summary.probes},
          {"rays", summary.rays},
          {"noise", summary.noise}};
}

nlohmann::ordered_json ToJson(const Statistics& statistics) {
  Json ignored = Json::array();
  for (const Ignored& one : statistics.scene.ignored) {
    ignored.push_back({{"feature", one.feature}, {"reason", one.reason}});
  }
  Json iterations = Json::array();
  for (const Iteration& iteration : statistics.iterations) {
    iterations.push_back(ToJson(iteration));
  }
  Json ray_shares = Json::object();
  for (const auto& [phase, share] : statistics.ray_shares) {
    ray_shares[phase] = share;
  }
  return {
      {"version", RADBAKE_VERSION},
      {"parameters", ToJson(statistics.parameters)},
      {"scene",
       {{"triangles", statistics.scene.triangles},
        {"patches", statistics.scene.patches},
        {"materials", statistics.scene.materials},
        {"lights", statistics.scene.lights},
        {"ignored", std::move(ignored)}}},
      {"iterations", std::move(iterations)},
      {"energy", ToJson(statistics.energy)},
      {"error",
       {{"estimated", statistics.estimated_error},
        {"measured", statistics.measured ? ToJson(*statistics.measured) : Json()}}},
      {"time", TimeToJson(statistics.seconds)},
      {"memory", MemoryToJson(statistics)},
      {"rays",
       {{"count", statistics.rays}, {"seconds", statistics.ray_seconds}, {"share", std::move(ray_shares)}}},
      {"output",
       {{"vertices", statistics.output.vertices},
        {"triangles", statistics.output.triangles},
        {"exposure", statistics.output.exposure}}},
      {"stopped_by", ToJson(statistics.stopped_by)},
      {"warnings", statistics.warnings}};
}

}  // namespace radbake
