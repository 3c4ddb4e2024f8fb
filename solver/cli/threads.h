/// --threads: how many threads the library may use.
#pragma once

#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/task_arena.h>

#include <optional>

namespace radbake::cli {

inline constexpr int kMostThreads = 1024;

/// Calls `work` where oneTBB's current arena has that many threads (nothing: as many as the machine).
template <typename Work>
auto WithThreads(std::optional<int> threads, const Work& work) {
  if (!threads) {
    return work();
  }
  const tbb::global_control control(tbb::global_control::max_allowed_parallelism,
                                    static_cast<std::size_t>(*threads));
  tbb::task_arena arena(*threads);
  return arena.execute(work);
}

}  // namespace radbake::cli
