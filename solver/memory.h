/// How much memory a bake may take, and what it counts itself to hold.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

#include "solver/scene/patches.h"

namespace radbake {

/// Bytes that this process can still take: what the machine has available, less where the control groups that
/// it is in (version 2) or its own resource limits leave less. `root`: where /proc and /sys are.
std::size_t FreeMemory(const std::filesystem::path& root = "/");

/// Of the process, so far.
std::size_t PeakBytes();

/// From now on malloc keeps a small part of `limit` for later of what is freed, and returns the rest to the
/// system at once. By itself it keeps as much as the largest block that was ever freed, beyond what a bake
/// counts; to keep nothing costs a third of a bake's time in page faults. For a program to ask.
void KeepFreed(std::size_t limit);

/// "1.9 GB", of 10⁹ bytes; two digits at least.
std::string BytesInWords(std::size_t bytes);

/// Thrown by a MemoryBudget that would be passed; never leaves Bake().
struct BeyondMemory {
  std::size_t bytes = 0;  ///< what was about to be held
};

/// Counts what a bake holds, by the sizes of its containers, and ends a step before it passes the limit. It
/// does not ask the process, which holds more or less by the number of threads and by chance.
class MemoryBudget {
 public:
  /// `input_bytes`: of the glTF with its buffers.
  MemoryBudget(std::size_t limit, std::size_t input_bytes, const Patches& patches);

  /// What the program and the scene take before anything is divided.
  std::size_t base() const { return base_; }
  std::size_t limit() const { return limit_; }
  /// The most that was held since the last call, the base too.
  std::size_t TakeMost();

  /// `bytes` beside the base. Throws BeyondMemory.
  void Check(std::size_t bytes);

 private:
  std::size_t limit_;
  std::size_t base_;
  std::size_t most_ = 0;
};

}  // namespace radbake
