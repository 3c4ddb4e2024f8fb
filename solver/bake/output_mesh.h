/// The mesh of the output: a cut through the element hierarchy, with irradiance at its vertices.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "solver/bake/baked_scene.h"
#include "solver/bake/gather.h"
#include "solver/bake/mesh_light.h"

namespace radbake {

/// Vertices are shared by all elements of one smooth or flat surface that meet there; where a neighbour is
/// divided further, its vertices on the common edge belong to both (no T-vertices, and no cracks even across
/// creases). It begins with the patches; RefineMesh or TakeSolution divides it.
///
/// Where a body stands on a surface, what lies under it is sealed: dark, and seen by nobody. A sealed vertex
/// gets its open neighbours' irradiance, for the sake of the triangles that reach out from under the body:
/// interpolated towards 0 they would show as dark teeth along its edge. Where the neighbours differ much, as
/// on the two sides of a wall, it gets the darkest one's: no light leaks through.
class OutputMesh {
 public:
  using Loop =
      std::vector<Index>;  ///< vertices around an element, counter-clockwise, beginning at its corner 0

  /// At a vertex or at an element's centre.
  struct Sample {
    Rgb irradiance = Rgb::Zero();  ///< normalised
    double variance = 0;           ///< of its rays
    bool gathered = false;
    bool sealed = false;
  };

  /// Where irradiance is gathered from: kSolution casts no ray.
  enum class Source { kRays, kSolution };

  /// `hold` is told of the hierarchy and of the mesh, with what it takes to emit it.
  OutputMesh(Hierarchy& hierarchy, const Gatherer& gatherer, const Links& links, Hold hold = {});

  /// Puts the four children of cut()[k] into its place and behind the last; the hierarchy grows where it has
  /// none there.
  void Divide(std::size_t k);

  /// Walks around the elements of the cut, and gathers at the vertices and centres where it has not yet.
  /// `stop`, if any, is asked now and then, on the caller's thread; if it says true, the cut is again that of
  /// the last call that was finished, and the answer is false. The same on any number of threads.
  bool Gather(const std::function<bool()>& stop, Source source = Source::kRays);

  /// Will gather everything once more, with `factor` times as many rays; what was gathered is kept until the
  /// next Gather is finished.
  void GatherAnew(double factor);

  /// From now on, what surfaces reflect is gathered as this mesh says, and no more as the solution does:
  /// wherever it is divided, that is finer. Of use by rays.
  void TakeOwnLight();

  /// Gives what is sealed the irradiance that is said above. Once, at the end.
  void CoverSealed();

  double effort() const { return effort_; }  ///< rays, in those of GatherOptions
  std::size_t vertex_count() const { return gathered_; }
  const Hierarchy& hierarchy() const { return hierarchy_; }
  const Gatherer& gatherer() const { return gatherer_; }
  const std::vector<Index>& cut() const { return cut_; }     ///< the elements of the output
  const std::vector<Loop>& loops() const { return loops_; }  ///< parallel to cut(), of the last Gather
  const Sample& AtVertex(Index vertex) const { return at_vertex_[vertex]; }
  const Sample& AtCentre(Index element) const { return at_centre_[element]; }  ///< by CentreWeights
  void SetAtVertex(Index vertex, const Sample& sample) { at_vertex_[vertex] = sample; }
  void SetAtCentre(Index element, const Sample& sample) { at_centre_[element] = sample; }
  bool IsLit(Index element) const { return lit_[hierarchy_[element].patch]; }

 private:
  void GrowWithHierarchy();
  void Tell() const;
  void WalkEdges();
  void WalkEdge(Index from, Index to, Loop& loop);
  bool GatherVertices(const std::function<bool()>& stop, Source source);
  bool GatherCentres(const std::function<bool()>& stop, Source source);
  Estimate At(const Vec3& x, Index leaf, std::uint64_t key, Source source, double effort) const;

  Hierarchy& hierarchy_;
  const Gatherer& gatherer_;
  Hold hold_;
  std::vector<bool> lit_;  // by patch: some link leads into it, or it lies under another
  std::vector<Index> cut_;
  std::vector<Loop> loops_;
  std::vector<Index> finished_cut_;
  std::vector<Loop> finished_loops_;
  std::vector<Sample> finished_at_vertex_;  // before GatherAnew
  std::vector<Sample> finished_at_centre_;
  std::vector<bool> used_;  // by position: a corner of some element of the cut
  std::vector<Sample> at_vertex_;
  std::vector<Sample> at_centre_;  // by element
  std::optional<MeshLight> light_;
  std::size_t gathered_ = 0;
  double effort_ = 1;
};

}  // namespace radbake
