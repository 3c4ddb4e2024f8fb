/// The control groups (version 2) that this process is in.
#pragma once

#include <cstdint>
#include <filesystem>

namespace radbake {

/// Bytes; the largest number where there is no limit.
struct GroupMemory {
  std::uint64_t most;  ///< that the processes of the groups may take together
  std::uint64_t left;  ///< of that, what they have not taken
};

/// The least of all groups that the process is in. `root`: where /proc and /sys are.
GroupMemory MemoryOfGroups(const std::filesystem::path& root);

}  // namespace radbake
