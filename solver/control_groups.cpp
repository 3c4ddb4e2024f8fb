#include "solver/control_groups.h"

#include <algorithm>
#include <fstream>
#include <limits>
#include <string>

namespace radbake {

GroupMemory MemoryOfGroups(const std::filesystem::path& root) {
  constexpr std::uint64_t kUnlimited = std::numeric_limits<std::uint64_t>::max();
  GroupMemory memory{kUnlimited, kUnlimited};
  constexpr std::string_view kVersion2 = "0::/";
  std::ifstream groups(root / "proc/self/cgroup");
  for (std::string line; std::getline(groups, line);) {
    if (!line.starts_with(kVersion2)) {
      continue;
    }
    const std::filesystem::path top = root / "sys/fs/cgroup";
    // A group may take no more than each of those that it is in.
    for (std::filesystem::path group = line.substr(kVersion2.size());; group = group.parent_path()) {
      std::uint64_t most = 0;
      std::uint64_t taken = 0;
      if (std::ifstream(top / group / "memory.max") >> most) {
        std::ifstream(top / group / "memory.current") >> taken;
        memory.most = std::min(memory.most, most);
        memory.left = std::min(memory.left, most - std::min(most, taken));
      }
      if (group.empty()) {
        break;
      }
    }
  }
  return memory;
}

}  // namespace radbake
