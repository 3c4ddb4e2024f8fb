/// A solution as the benchmarks judge it: by the irradiance at places all over the scene.
#pragma once

#include <cmath>
#include <vector>

#include "solver/bake/gather.h"
#include "solver/solve/solver.h"

namespace radbake::bench {

struct Solved {
  Solved(const Patches& patches, const SolveOptions& options)
      : hierarchy(patches), visibility(patches), solution(Solve(hierarchy, visibility, options)) {}
  Hierarchy hierarchy;
  Visibility visibility;
  Solution solution;
};

/// The irradiance at places all over the patches, by area: as the solution has it, or gathered.
struct Read {
  std::vector<Rgb> solution;
  std::vector<Rgb> gathered;
};

inline Read ReadAt(const Solved& solved, const GatherOptions& options) {
  constexpr double kPlaces = 2000;
  const Gatherer gatherer(solved.hierarchy, solved.solution.light, solved.solution.links, solved.visibility,
                          options);
  Read read;
  const Patches& patches = solved.hierarchy.patches();
  for (Index root = 0; root < solved.hierarchy.surface_root_count(); ++root) {
    const Polygon shape = solved.hierarchy.Shape(root);
    QuasiRandom<2> random(Hash(root));
    const auto count = static_cast<int>(std::ceil(kPlaces * patches.patches[root].area / patches.area));
    for (int k = 0; k < count; ++k) {
      const auto u = random.Next();
      const Vec3 x = PointOn(shape, u[0], u[1]);
      const Index leaf = gatherer.SolverLeaf(root, x);
      const bool sealed = gatherer.IsSealed(x, leaf);
      read.solution.push_back(sealed ? Rgb(Rgb::Zero()) : gatherer.Solved(leaf, x));
      read.gathered.push_back(sealed ? Rgb(Rgb::Zero())
                                     : gatherer.Irradiance(x, leaf, Hash(read.gathered.size())).irradiance);
    }
  }
  return read;
}

/// RMS of the difference, relative to the reference.
inline double Difference(const std::vector<Rgb>& a, const std::vector<Rgb>& reference) {
  double difference = 0;
  double square = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    difference += (a[i] - reference[i]).square().sum();
    square += reference[i].square().sum();
  }
  return std::sqrt(difference / square);
}

}  // namespace radbake::bench
