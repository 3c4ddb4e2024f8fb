/// radbake: glTF in, baked glTF out. The way into the library; each folder below is one step of the bake.
#pragma once

#include <functional>
#include <optional>
#include <stdexcept>
#include <string>

#include "solver/gltf/document.h"
#include "solver/parameters.h"
#include "solver/statistics.h"

namespace radbake {

/// What a running bake tells its caller, a few times a second at most, from the thread that called Bake().
struct Progress {
  std::string_view phase;  ///< "import", "solve", "gather", "export", "check"
  double fraction = 0;     ///< of the whole bake, 0 to 1, never falling
  double error = 1;        ///< estimated relative RMS error so far
  double seconds = 0;      ///< since the bake began
  Iteration iteration;     ///< the newest, for live statistics
};
enum class Continue { kYes, kStop };
using ProgressCallback = std::function<Continue(const Progress&)>;

/// Thrown by Bake() when the callback said kStop. Nothing is left behind.
class Interrupted : public std::exception {
 public:
  const char* what() const noexcept override { return "interrupted"; }
};

/// Thrown by Bake() where even the coarsest bake would take more memory than the limit, or the system gave
/// none: one line, "out of memory: …", that says what the scene takes at least.
class OutOfMemory : public std::runtime_error {
 public:
  /// `needed`: what it would take at least, or, below `limit`, what the system gave.
  OutOfMemory(std::size_t needed, std::size_t limit);
};

struct BakeResult {
  std::string glb;
  Statistics statistics;
};

/// Bakes the scene. Uses oneTBB's current task arena; the result's bytes do not depend on its size. Throws
/// InputError (the scene or the parameters), Interrupted, OutOfMemory.
///
/// `memory_limit`: bytes that the process may take (nothing: FreeMemory()). Where the bake would take more,
/// it is one of a coarser error: the statistics' `stopped_by` is kLimit then, and a warning says which.
BakeResult Bake(const gltf::Source& source, const Parameters& parameters,
                const ProgressCallback& progress = {}, const gltf::Limits& limits = {},
                std::optional<std::size_t> memory_limit = {});

}  // namespace radbake
