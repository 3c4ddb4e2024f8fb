/// What a child process may do: limits of the kernel's, no network, no privileges, no files but its own.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <filesystem>

#include "server/files.h"

namespace radbake::server {

/// 0: no limit.
struct ChildLimits {
  std::uint64_t memory = 0;     ///< bytes of data (RLIMIT_DATA)
  std::uint64_t file_size = 0;  ///< bytes of any one file that it writes
  std::uint64_t open_files = 0;
  std::chrono::seconds cpu_time{0};  ///< of all its threads together
  std::chrono::seconds time{0};      ///< from its start to its end
  /// It reads the system's folders and its program's, reads and writes its working folder, and nothing else.
  /// Without effect where the kernel has no Landlock.
  bool confined = false;
};

/// Made before fork(), entered after it. No child gets a network, privileges to gain (no_new_privs), other
/// processes to signal or trace, or core files: those are not options.
class Sandbox {
 public:
  /// Throws std::system_error where the kernel refuses what it has.
  Sandbox(const ChildLimits& limits, const std::filesystem::path& program,
          const std::filesystem::path& folder);

  /// In the child: for good, and for all that it starts. Async-signal-safe. False if it cannot be.
  bool Enter() const;

  /// Whether this kernel has Landlock.
  static bool CanConfine();

 private:
  bool Limit() const;

  ChildLimits limits_;
  Descriptor ruleset_;
};

}  // namespace radbake::server
