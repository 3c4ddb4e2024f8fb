#include "server/memory.h"

#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <string>

namespace radbake::server {

std::uint64_t MemoryBytes(const std::filesystem::path& root) {
  std::uint64_t bytes = static_cast<std::uint64_t>(::sysconf(_SC_PHYS_PAGES)) *
                        static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
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
      if (std::ifstream(top / group / "memory.max") >> most) {
        bytes = std::min(bytes, most);
      }
      if (group.empty()) {
        break;
      }
    }
  }
  return bytes;
}

}  // namespace radbake::server
