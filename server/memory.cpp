#include "server/memory.h"

#include <unistd.h>

#include <algorithm>

#include "solver/control_groups.h"

namespace radbake::server {

std::uint64_t MemoryBytes(const std::filesystem::path& root) {
  const std::uint64_t machine = static_cast<std::uint64_t>(::sysconf(_SC_PHYS_PAGES)) *
                                static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
  return std::min(machine, MemoryOfGroups(root).most);
}

}  // namespace radbake::server
