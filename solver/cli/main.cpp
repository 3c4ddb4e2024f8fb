// radbake: the command line of the library. Exit codes: 0 done; 1 failed; 2 bad usage, parameters or scene;
// 130 interrupted.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <new>
#include <string>

#include "solver/cli/bake_command.h"
#include "solver/cli/check_command.h"
#include "solver/cli/output_files.h"
#include "solver/cli/text.h"

namespace {

constexpr int kFailed = 1;
constexpr int kBadInput = 2;

int Fail(std::string_view message, int code) {
  std::fputs(("radbake: " + radbake::cli::OneLine(message) + "\n").c_str(), stderr);
  return code;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    CLI::App app{"radbake: bakes diffuse global illumination into glTF scenes", "radbake"};
    app.set_version_flag("--version", "radbake " RADBAKE_VERSION);
    app.require_subcommand(1);
    const radbake::cli::BakeCommand bake(app);
    const radbake::cli::CheckCommand check(app);
    try {
      app.parse(argc, argv);
    } catch (const CLI::Success& success) {
      return app.exit(success);
    } catch (const CLI::ParseError& error) {
      return Fail(error.what(), kBadInput);
    }
    radbake::cli::ExitOnSignals();
    if (bake.Chosen()) {
      bake.Run();
    } else {
      check.Run();
    }
    return 0;
  } catch (const radbake::InputError& error) {
    return Fail(error.what(), kBadInput);
  } catch (const std::bad_alloc&) {
    return Fail("out of memory", kFailed);
  } catch (const std::exception& error) {
    return Fail(error.what(), kFailed);
  }
}
