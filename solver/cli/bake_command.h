/// radbake bake SCENE -o BAKED.glb
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "solver/gltf/document.h"
#include "solver/parameters.h"

namespace radbake::cli {

class BakeCommand {
 public:
  /// Adds the subcommand. `this` must outlive the parsing.
  explicit BakeCommand(CLI::App& app);

  bool Chosen() const { return command_->parsed(); }

  /// Bakes and writes the files. Throws InputError, OutputError and what Bake() throws.
  void Run() const;

 private:
  Parameters ReadParameters() const;

  CLI::App* command_;
  std::string scene_;
  std::string output_;
  gltf::Limits limits_;
  std::string parameters_file_;
  std::string statistics_file_;
  std::optional<int> threads_;
  std::optional<std::size_t> memory_limit_;
  std::string progress_ = "auto";
  std::vector<std::pair<std::string_view, std::string>> flags_;  ///< a parameter's key, the flag's text
};

}  // namespace radbake::cli
