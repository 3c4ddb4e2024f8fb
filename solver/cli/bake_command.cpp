#include "solver/cli/bake_command.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <system_error>

#include "solver/cli/output_files.h"
#include "solver/cli/progress.h"
#include "solver/cli/text.h"
#include "solver/cli/threads.h"
#include "solver/memory.h"
#include "solver/radbake.h"

namespace radbake::cli {
namespace {

/// "--time-budget,--time_budget"; the contract's name of output.kind is --output.
std::string FlagNames(std::string_view key) {
  const std::string name = "--" + std::string(key);
  std::string hyphenated = name;
  std::ranges::replace(hyphenated, '_', '-');
  std::string names = hyphenated == name ? name : hyphenated + "," + name;
  if (key == "output.kind") {
    names = "--output," + names;
  }
  return names;
}

std::string Help(const ParameterSpec& spec) {
  std::string help = std::string(spec.means) + " (takes " + std::string(spec.takes);
  const nlohmann::json value = spec.write(Parameters());
  if (!value.is_null()) {
    help += "; default " + (value.is_string() ? value.get<std::string>() : value.dump());
  }
  return help + ")";
}

std::string ReadText(const std::string& path) {
  constexpr std::size_t kEnough = 1 << 20;
  std::ifstream file(path, std::ios::binary);
  std::string text(kEnough, '\0');
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (!file.is_open() || file.bad()) {
    throw InputError("cannot read " + path + ": " + std::generic_category().message(errno));
  }
  text.resize(static_cast<std::size_t>(file.gcount()));
  return text;
}

bool SameFile(const std::string& a, const std::string& b) {
  std::error_code error;
  return std::filesystem::weakly_canonical(a, error) == std::filesystem::weakly_canonical(b, error);
}

std::string Summary(const std::string& output, const Statistics& statistics, double seconds) {
  std::string line = output + ": ";
  if (statistics.measured) {
    const CheckSummary& measured = *statistics.measured;
    line += "error " + Percent(measured.error) + " (" + Percent(measured.error_low) + " to " +
            Percent(measured.error_high) + "), bias " + SignedPercent(measured.bias) + " ± " +
            Percent(measured.bias_interval);
  } else {
    line += "estimated error " + Percent(statistics.estimated_error);
  }
  line += ", " + std::to_string(statistics.output.vertices) + " vertices, " + Duration(seconds);
  return line;
}

void PrintWarnings(const Statistics& statistics) {
  for (const std::string& warning : statistics.warnings) {
    std::fputs(("radbake: warning: " + OneLine(warning) + "\n").c_str(), stderr);
  }
}

}  // namespace

BakeCommand::BakeCommand(CLI::App& app)
    : command_(app.add_subcommand("bake", "Bakes the light of a scene into it")) {
  command_->add_option("SCENE", scene_, "a .glb, or a .gltf with its files beside it")->required();
  command_->add_option("-o", output_, "the baked .glb to write")->required()->type_name("BAKED.glb");
  command_->add_option("--parameters", parameters_file_, "read parameters from it; a flag wins")
      ->type_name("P.json");
  command_->add_option("--statistics", statistics_file_, "write the statistics there")->type_name("S.json");
  command_->add_option("--threads", threads_, "how many to use (default: one a core)")
      ->check(CLI::Range(1, kMostThreads))
      ->type_name("N");
  command_
      ->add_option("--memory-limit", memory_limit_,
                   "bytes that the process may take, or such as 400MB or 2GiB (default: what the machine has "
                   "free); where this is too little the bake is coarser, with a warning")
      ->transform(CLI::AsSizeValue(true))
      ->check(CLI::Range(1.0, 1e18))
      ->type_name("BYTES");
  command_
      ->add_option("--progress", progress_,
                   "auto (a bar on a terminal), json (an object a line on standard output) or none")
      ->check(CLI::IsMember({"auto", "json", "none"}))
      ->type_name("MODE");
  const auto add_limit = [&](const char* flag, auto& value, const char* means) {
    command_->add_option(flag, value, means)->capture_default_str()->group("Limits");
  };
  add_limit("--max-triangles", limits_.triangles, "triangles and primitives that a scene may have");
  add_limit("--max-nodes", limits_.nodes, "nodes that a glTF may have");
  add_limit("--max-json-depth", limits_.json_depth, "levels that its JSON may be nested");
  add_limit("--max-texture-pixels", limits_.texture_pixels, "pixels of all images together");
  for (const ParameterSpec& spec : ParameterSpecs()) {
    command_
        ->add_option_function<std::string>(
            FlagNames(spec.key),
            [this, key = spec.key](const std::string& text) { flags_.emplace_back(key, text); }, Help(spec))
        ->type_name("")
        ->group("Parameters");
  }
}

Parameters BakeCommand::ReadParameters() const {
  Parameters parameters;
  if (!parameters_file_.empty()) {
    const std::string text = ReadText(parameters_file_);
    try {
      parameters = ParseParameters(text);
    } catch (const InputError& error) {
      throw InputError(parameters_file_ + ": " + error.what());
    }
  }
  for (const auto& [key, text] : flags_) {
    SetParameter(key, text, parameters);
  }
  return parameters;
}

void BakeCommand::Run() const {
  const ProgressMode mode = progress_ == "json"   ? ProgressMode::kJson
                            : progress_ == "none" ? ProgressMode::kNone
                                                  : ProgressMode::kAuto;
  const auto begin = std::chrono::steady_clock::now();
  const Parameters parameters = ReadParameters();
  if (SameFile(scene_, output_)) {
    throw InputError("-o names the scene itself");
  }
  if (SameFile(statistics_file_, output_)) {
    throw InputError("-o and --statistics name the same file");
  }
  CheckWritable(output_);
  if (!statistics_file_.empty()) {
    CheckWritable(statistics_file_);
  }

  const std::size_t memory_limit = memory_limit_.value_or(FreeMemory());
  KeepFreed(memory_limit);
  const BakeResult result = [&] {
    ProgressDisplay display(mode);
    const gltf::Source source = gltf::ReadSource(scene_);
    return WithThreads(threads_, [&] {
      return Bake(
          source, parameters,
          [&](const Progress& progress) {
            display.Show(progress);
            return Continue::kYes;
          },
          limits_, memory_limit);
    });
  }();

  PrintWarnings(result.statistics);
  const std::string statistics = ToJson(result.statistics).dump(2) + "\n";
  std::vector<OutputFile> files{{output_, result.glb}};
  if (!statistics_file_.empty()) {
    files.push_back({statistics_file_, statistics});
  }
  WriteWhole(files);
  if (mode != ProgressMode::kJson) {
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
    std::puts(Summary(output_, result.statistics, seconds.count()).c_str());
  }
}

}  // namespace radbake::cli
