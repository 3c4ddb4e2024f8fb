#include "solver/memory.h"

#include <malloc.h>
#include <oneapi/tbb/task_arena.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <iomanip>
#include <limits>
#include <sstream>
#include <utility>

#include "solver/control_groups.h"
#include "solver/radbake.h"

namespace radbake {
namespace {

// Measured, and rounded up: the program with its libraries; the copies of the input that reading and writing
// it keep at once; a triangle for Embree and beside it; a patch with its shape, its cluster and the light on
// both.
constexpr std::size_t kOfProgram = 16'000'000;
constexpr std::size_t kOfInput = 3;
constexpr std::size_t kOfTriangle = 500;
constexpr std::size_t kOfPatch = 500;
// What malloc needs beyond what it gives, in the end.
constexpr double kOverhead = 1.1;

std::uint64_t LeftByMachine(const std::filesystem::path& root) {
  std::ifstream info(root / "proc/meminfo");
  for (std::string line; std::getline(info, line);) {
    std::istringstream words(line);
    std::string name;
    std::uint64_t kib = 0;
    if (words >> name >> kib && name == "MemAvailable:") {
      return kib * 1024;
    }
  }
  return static_cast<std::uint64_t>(::sysconf(_SC_PHYS_PAGES)) *
         static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
}

/// Such limits count what is reserved: the stacks of oneTBB's threads, of which little is ever used.
std::uint64_t LeftByResourceLimits() {
  constexpr std::uint64_t kStack = 4U << 20U;
  const std::uint64_t stacks = kStack * static_cast<std::uint64_t>(tbb::this_task_arena::max_concurrency());
  std::uint64_t left = std::numeric_limits<std::uint64_t>::max();
  for (const auto resource : {RLIMIT_AS, RLIMIT_DATA}) {
    rlimit limit{};
    if (::getrlimit(resource, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY) {
      left = std::min<std::uint64_t>(left, limit.rlim_cur - std::min<std::uint64_t>(limit.rlim_cur, stacks));
    }
  }
  return left;
}

}  // namespace

std::size_t FreeMemory(const std::filesystem::path& root) {
  return std::min({LeftByMachine(root), MemoryOfGroups(root).left, LeftByResourceLimits()});
}

std::size_t PeakBytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::size_t>(usage.ru_maxrss) * 1024;
}

void KeepFreed(std::size_t limit) {
  constexpr std::size_t kKilo = 1024;
  const auto part = [&](std::size_t share, std::size_t most) {
    return static_cast<int>(std::clamp(limit / share, 128 * kKilo, most));
  };
  mallopt(M_MMAP_THRESHOLD, part(128, 4 * kKilo * kKilo));
  mallopt(M_TRIM_THRESHOLD, part(32, 64 * kKilo * kKilo));
}

std::string BytesInWords(std::size_t bytes) {
  constexpr double kMega = 1e6;
  constexpr double kGiga = 1e9;
  const bool large = static_cast<double>(bytes) >= kGiga;
  const double value = static_cast<double>(bytes) / (large ? kGiga : kMega);
  std::ostringstream text;
  text << std::fixed << std::setprecision(value < 10 ? 1 : 0) << value << (large ? " GB" : " MB");
  return text.str();
}

OutOfMemory::OutOfMemory(std::size_t needed, std::size_t limit)
    : std::runtime_error(needed > limit
                             ? "out of memory: the scene takes at least " + BytesInWords(needed) +
                                   " however coarsely it is baked, and the limit is " + BytesInWords(limit)
                             : "out of memory: the system gave no more than " + BytesInWords(needed) +
                                   ", below the limit of " + BytesInWords(limit)) {}

MemoryBudget::MemoryBudget(std::size_t limit, std::size_t input_bytes, const Patches& patches)
    : limit_(limit),
      base_(kOfProgram + kOfInput * input_bytes + kOfTriangle * patches.blockers.size() +
            kOfPatch * patches.patches.size()) {}

std::size_t MemoryBudget::TakeMost() {
  return std::exchange(most_, 0);
}

void MemoryBudget::Check(std::size_t bytes) {
  const std::size_t held = base_ + static_cast<std::size_t>(kOverhead * static_cast<double>(bytes));
  most_ = std::max(most_, held);
  if (held > limit_) {
    throw BeyondMemory{held};
  }
}

}  // namespace radbake
