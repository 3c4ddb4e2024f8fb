/// Which elements of the output mesh are divided, and when that ends.
#pragma once

#include <functional>

#include "solver/bake/output_mesh.h"

namespace radbake {

struct MeshOptions {
  double error = 0.01;       ///< target: relative RMS error of the interpolation
  double noise = 0.01;       ///< target: relative RMS error of the rays' noise
  double start_area = 1e-3;  ///< lit elements above this share of the scene's area are divided unseen
  double near_area = 1e-5;   ///< and those above this share on which something stands
  double min_area = 1e-8;    ///< elements below this share are not divided
  std::size_t max_vertices = 4'000'000;
  /// Called now and then, on the caller's thread, with the estimated error and the vertices so far; true ends
  /// the refinement with the last round that was finished.
  std::function<bool(double error, std::size_t vertices)> stop;
};

/// kLimit: the rays are too few, or the vertices too many, for the target.
enum class MeshEnd { kError, kLimit, kStopped };

struct MeshSummary {
  MeshEnd end = MeshEnd::kError;
  double error = 1;  ///< estimated relative RMS error of the interpolation
  double noise = 0;  ///< and of the rays' noise
};

/// Divides the elements whose centre is farthest from what their corners interpolate to, worst first, until
/// the estimated error of the whole is below the target. What is stopped before the input's own vertices
/// are gathered takes the rest of them from the solution. The same on any number of threads. Of a mesh that
/// is new.
MeshSummary RefineMesh(OutputMesh& mesh, const MeshOptions& options);

/// Instead: the solver's leaves as they are, with the mean of what the solution has where they meet (linear
/// interpolation of constants: Cohen, Greenberg 1985); quadratic ones once divided. Casts no ray.
MeshSummary TakeSolution(OutputMesh& mesh);

}  // namespace radbake
