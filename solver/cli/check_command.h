/// radbake check SCENE BAKED.glb
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>

#include "solver/check/check.h"
#include "solver/parameters.h"

namespace radbake::cli {

class CheckCommand {
 public:
  /// Adds the subcommand. `this` must outlive the parsing.
  explicit CheckCommand(CLI::App& app);

  bool Chosen() const { return command_->parsed(); }

  /// Measures and prints. Throws InputError, and std::runtime_error after printing if the bake lacks most of
  /// the scene's surface.
  void Run() const;

 private:
  CLI::App* command_;
  std::string scene_;
  std::string baked_;
  CheckOptions options_;
  Parameters parameters_;  ///< of which only the environment is asked for
  std::optional<int> threads_;
  bool json_ = false;
};

}  // namespace radbake::cli
