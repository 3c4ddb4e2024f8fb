#include "solver/cli/check_command.h"

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "solver/cli/text.h"
#include "solver/cli/threads.h"
#include "solver/gltf/document.h"
#include "solver/statistics.h"

namespace radbake::cli {
namespace {

constexpr std::size_t kMostProbes = 1'000'000;
constexpr double kForeign = 0.5;  // no bake of the scene lacks this share of it

std::string Report(const CheckSummary& summary) {
  return "relative RMS error " + Percent(summary.error) + " (95 %: " + Percent(summary.error_low) + " to " +
         Percent(summary.error_high) + ")\nbias " + SignedPercent(summary.bias) + " (95 %: ± " +
         Percent(summary.bias_interval) + ")\nmissing " + Percent(summary.missing) + " of " +
         std::to_string(summary.probes) + " probes\nnoise of the references " + Percent(summary.noise) +
         " (taken out of the error), " + std::to_string(summary.rays) + " rays";
}

}  // namespace

CheckCommand::CheckCommand(CLI::App& app)
    : command_(app.add_subcommand("check", "Measures the error of a bake, by path tracing")) {
  command_->add_option("SCENE", scene_, "the scene that was baked")->required();
  command_->add_option("BAKED", baked_, "the .glb that `bake` wrote")->required();
  command_->add_option("--probes", options_.probes, "how many places are compared")
      ->check(CLI::Range(std::size_t{1}, kMostProbes))
      ->capture_default_str()
      ->type_name("N");
  command_->add_option("--threads", threads_, "how many to use (default: one a core)")
      ->check(CLI::Range(1, kMostThreads))
      ->type_name("N");
  const auto spec = std::ranges::find(ParameterSpecs(), "environment.radiance", &ParameterSpec::key);
  command_
      ->add_option_function<std::string>(
          "--" + std::string(spec->key),
          [this, key = spec->key](const std::string& text) { SetParameter(key, text, parameters_); },
          "what it was baked with: " + std::string(spec->means) + " (takes " + std::string(spec->takes) + ")")
      ->type_name("");
  command_->add_flag("--json", json_, "print JSON: the statistics' error.measured");
}

void CheckCommand::Run() const {
  gltf::Document document(gltf::ReadSource(scene_));
  document.SetEnvironment(parameters_.environment);
  const BakedTriangles baked = gltf::ReadIrradiance(gltf::ReadSource(baked_));
  const CheckSummary summary =
      WithThreads(threads_, [&] { return Check(document.scene(), baked, options_); });
  std::puts((json_ ? ToJson(summary).dump() : Report(summary)).c_str());
  if (summary.missing > kForeign) {
    throw std::runtime_error(baked_ + " is not a bake of " + scene_ + ": it has no surface at " +
                             Percent(summary.missing) + " of the probes");
  }
}

}  // namespace radbake::cli
