/// One bake in a process of its own.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "server/files.h"
#include "server/sandbox.h"
#include "server/stop_signal.h"

namespace radbake::server {

struct ChildCommand {
  std::filesystem::path program;
  std::vector<std::string> arguments;
  std::filesystem::path folder;  ///< its working directory
  ChildLimits limits;
};

struct ChildEnd {
  int exit_code = -1;  ///< -1: it did not exit
  int signal = 0;      ///< 0: it was not killed
  bool late = false;   ///< it took longer than its limit, and was stopped
  std::string error;   ///< its last line on standard error
  std::string log;     ///< its last lines on standard error, a few thousand bytes of them
};

/// Runs the program to its end. Its standard input is /dev/null and it inherits no other descriptor, and of
/// the environment all but what PostgreSQL's client reads (PG…), among which may be a password. `on_line`
/// gets each whole line of its standard output (at most 64 KiB long; longer ones are left out).
///
/// When `stop` is raised or its time is up the child gets SIGTERM, and SIGKILL if it is still there two
/// seconds later. The child is killed by the kernel when the *thread* that called this function ends: call it
/// from one that outlives it. A program that cannot be started ends with exit code 127. Throws
/// std::system_error if there is no process to be had.
ChildEnd RunChild(const ChildCommand& command, const std::function<void(std::string_view)>& on_line,
                  const StopSignal& stop);

}  // namespace radbake::server
