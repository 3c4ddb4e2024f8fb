/// A scene on its way through the solver, step by step as Bake() takes it.
#pragma once

#include "solver/bake/emit.h"
#include "solver/bake/gather.h"
#include "solver/bake/mesh_refinement.h"
#include "solver/bake/output_mesh.h"
#include "solver/hierarchy/hierarchy.h"
#include "solver/scene/patches.h"
#include "solver/solve/solver.h"
#include "solver/transport/visibility.h"

namespace radbake::testing {

struct SolvedScene {
  SolvedScene(const Scene& scene, const SolveOptions& options)
      : surface_count(scene.surfaces.size()),
        patches(CutIntoPatches(scene)),
        hierarchy(patches),
        visibility(patches),
        solution(Solve(hierarchy, visibility, options)) {}
  SolvedScene(const SolvedScene&) = delete;
  SolvedScene& operator=(const SolvedScene&) = delete;

  BakedScene Output(const MeshOptions& options) {
    const Gatherer gatherer(hierarchy, solution.light, solution.links, visibility, GatherOptions());
    OutputMesh mesh(hierarchy, gatherer, solution.links);
    RefineMesh(mesh, options);
    return Emit(hierarchy, mesh, surface_count, 1.0);
  }

  std::size_t surface_count;
  Patches patches;
  Hierarchy hierarchy;
  Visibility visibility;
  Solution solution;
};

/// Calls `visit` with every link that lights the leaf: its own, and those into its ancestors.
template <typename Visit>
void ForEachLinkInto(const Links& links, const Hierarchy& hierarchy, Index leaf, const Visit& visit) {
  for (Index e = leaf; e != kNone; e = hierarchy[e].parent) {
    for (const Link& link : links.Into(e)) {
      visit(link);
    }
  }
}

}  // namespace radbake::testing
