/// The mesh of the output: a cut through the element hierarchy, divided where irradiance is not linear.
#pragma once

#include <functional>
#include <vector>

#include "solver/bake/baked_scene.h"
#include "solver/bake/gather.h"

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

/// Irradiance at the vertices of a cut through the hierarchy. Vertices are shared by all elements of one
/// smooth or flat surface that meet there; where a neighbour is divided further, its vertices on the common
/// edge belong to both (no T-vertices, and no cracks even across creases).
///
/// Where a body stands on a surface, what lies under it is sealed: dark, and seen by nobody. A sealed vertex
/// gets its open neighbours' irradiance, for the sake of the triangles that reach out from under the body:
/// interpolated towards 0 they would show as dark teeth along its edge. Where the neighbours differ much, as
/// on the two sides of a wall, it gets the darkest one's: no light leaks through.
class OutputMesh {
 public:
  using Loop =
      std::vector<Index>;  ///< vertices around an element, counter-clockwise, beginning at its corner 0

  /// `hold` is told of the hierarchy and of the mesh, with what it takes to emit it.
  OutputMesh(Hierarchy& hierarchy, const Gatherer& gatherer, const Links& links, Hold hold = {});

  /// Divides the elements whose centre is farthest from what their corners interpolate to, worst first, until
  /// the estimated error of the whole is below the target. What is stopped before the input's own vertices
  /// are gathered takes the rest of them from the solution. The same on any number of threads. Once only.
  MeshEnd Refine(const MeshOptions& options);

  /// Instead: the solver's leaves as they are, with the mean of what the solution has where they meet (linear
  /// interpolation of constants: Cohen, Greenberg 1985); quadratic ones once divided. Casts no ray.
  void TakeSolution();

  /// Estimated relative RMS error of the interpolation, and of the rays' noise.
  double error() const { return error_; }
  double noise() const { return noise_; }
  std::size_t vertex_count() const { return gathered_; }
  const std::vector<Index>& cut() const { return cut_; }     ///< the elements of the output
  const std::vector<Loop>& loops() const { return loops_; }  ///< parallel to cut()
  const Rgb& Irradiance(Index vertex) const { return at_vertex_[vertex].irradiance; }  ///< normalised
  const Rgb& CentreIrradiance(Index element) const {                                   ///< at ElementCentre()
    return at_centre_[element].irradiance;
  }

 private:
  struct Sample {
    Rgb irradiance = Rgb::Zero();
    double variance = 0;  // of its rays
    bool gathered = false;
    bool sealed = false;
  };
  /// Of an element's centre from the mean of its corners.
  struct Deviation {
    Rgb mean = Rgb::Zero();
    double squared = 0;
    double noise = 0;  // of `squared`, what the rays' variance explains
  };

  MeshEnd DivideWhereItMatters(const MeshOptions& options);
  void GrowWithHierarchy();
  /// Those above `area`, and above `near_area` where something stands on them.
  void DivideUnseen(double area, double near_area);
  void Divide(Index element);
  void Tell() const;
  void WalkEdges();
  void WalkEdge(Index from, Index to, Loop& loop);
  enum class Source { kRays, kSolution };
  bool GatherVertices(const std::function<bool()>& stop, Source source = Source::kRays);
  bool GatherCentres(const std::function<bool()>& stop, Source source = Source::kRays);
  Estimate At(const Vec3& x, Index leaf, std::uint64_t key, Source source, double effort) const;
  Deviation DeviationOf(Index element) const;
  double ErrorPerDeviation(Index element, const Deviation& deviation) const;
  std::vector<double> SquaredErrors();
  void SpendAsNeeded(double noise);
  void CoverSealed();
  bool IsLit(Index element) const { return lit_[hierarchy_[element].patch]; }

  Hierarchy& hierarchy_;
  const Gatherer& gatherer_;
  Hold hold_;
  std::vector<bool> lit_;  // by patch: some link leads into it, or it lies under another
  std::vector<Index> cut_;
  std::vector<Loop> loops_;
  std::vector<bool> used_;  // by position: a corner of some element of the cut
  std::vector<Sample> at_vertex_;
  std::vector<Sample> at_centre_;  // by element
  std::size_t gathered_ = 0;
  double error_ = 1;
  double noise_ = 0;
  double effort_ = 1;
};

/// Weights of an element's corners at its centre: dyadic, so that they sum to exactly 1 in float too.
inline std::array<float, 4> CentreWeights(const Element& element) {
  constexpr float kUnit = 1.0F / 1024;
  return element.CornerCount() == 4 ? std::array{0.25F, 0.25F, 0.25F, 0.25F}
                                    : std::array{341 * kUnit, 341 * kUnit, 342 * kUnit, 0.0F};
}

}  // namespace radbake
