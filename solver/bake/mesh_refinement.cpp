#include "solver/bake/mesh_refinement.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "solver/bake/neighbourhood.h"
#include "solver/bake/smoothing.h"

namespace radbake {
namespace {

// Mean square of the interpolation error over an element, in squares of how far the centre is from what the
// corners say: where a shadow's edge crosses the element, and where irradiance is smooth.
constexpr double kEdge = 0.4;
constexpr double kSmooth = 1.0 / 30;

// Of the rays' variance at the centre and the corners together, what is left of it between them.
constexpr double kNoiseLeft = 0.5;

/// Of an element's centre from the mean of its corners.
struct Deviation {
  Rgb mean = Rgb::Zero();
  double squared = 0;
  double noise = 0;  // of `squared`, what the rays' variance explains
};

Deviation DeviationOf(const OutputMesh& mesh, Index e) {
  const Element& element = mesh.hierarchy()[e];
  const OutputMesh::Sample& centre = mesh.AtCentre(e);
  Deviation result;
  Rgb squares = Rgb::Zero();
  double open = 0;
  for (int c = 0; c < element.CornerCount(); ++c) {
    const OutputMesh::Sample& corner = mesh.AtVertex(element.corner[static_cast<std::size_t>(c)]);
    if (!corner.sealed) {
      result.mean += corner.irradiance;
      squares += corner.irradiance.square();
      result.noise += corner.variance;
      ++open;
    }
  }
  if (open == 0) {
    return {.mean = centre.irradiance};
  }
  result.mean /= open;
  result.noise /= open * open;
  if (!centre.sealed) {
    result.squared = (centre.irradiance - result.mean).square().sum();
    result.noise += centre.variance;
  } else {
    result.squared = (squares / open - result.mean.square()).max(0.0).sum();
  }
  return result;
}

double ErrorPerDeviation(const OutputMesh& mesh, Index e, const Deviation& deviation) {
  const Index parent = mesh.hierarchy()[e].parent;
  if (parent == kNone || !mesh.AtCentre(parent).gathered) {
    return kEdge;
  }
  const Deviation above = DeviationOf(mesh, parent);
  const double before = above.squared - above.noise;
  const double now = std::max(0.0, deviation.squared - deviation.noise);
  // Where irradiance is smooth, halving lowers its deviation to a quarter; at an edge it stays.
  constexpr double kSmoothFall = 1.0 / 16;
  constexpr double kEdgeFall = 1.0 / 4;
  if (!(before > 0)) {
    return kEdge;
  }
  const double edge = std::clamp((now / before - kSmoothFall) / (kEdgeFall - kSmoothFall), 0.0, 1.0);
  return kSmooth + edge * (kEdge - kSmooth);
}

struct MeshError {
  std::vector<double> squared;  // of interpolation, by element of the cut
  double interpolation = 0;     // relative RMS
  double noise = 0;
};

MeshError ErrorOf(const OutputMesh& mesh) {
  MeshError result;
  result.squared.resize(mesh.cut().size());
  double norm = 0;
  double interpolation = 0;
  double noise = 0;
  for (std::size_t k = 0; k < mesh.cut().size(); ++k) {
    const Index e = mesh.cut()[k];
    const Deviation deviation = DeviationOf(mesh, e);
    const double area = mesh.hierarchy()[e].area;
    const double share = area * ErrorPerDeviation(mesh, e, deviation);
    // What the rays' noise adds to the deviation of many, it does not add to the error of interpolation.
    result.squared[k] = share * std::max(0.0, deviation.squared - deviation.noise);
    interpolation += share * (deviation.squared - deviation.noise);
    noise += kNoiseLeft * area * deviation.noise;
    norm += area * deviation.mean.square().sum();
  }
  if (norm > 0) {
    result.interpolation = std::sqrt(std::max(0.0, interpolation) / norm);
    result.noise = std::sqrt(noise / norm);
  }
  return result;
}

/// Relative RMS, of neighbours that may err alike.
double NoiseOf(const OutputMesh& mesh) {
  double norm = 0;
  double noise = 0;
  for (const Index e : mesh.cut()) {
    const Element& element = mesh.hierarchy()[e];
    const OutputMesh::Sample& centre = mesh.AtCentre(e);
    double variance = centre.variance;
    for (int c = 0; c < element.CornerCount(); ++c) {
      variance += mesh.AtVertex(element.corner[static_cast<std::size_t>(c)]).variance / element.CornerCount();
    }
    noise += element.area * variance / 2;
    norm += element.area * centre.irradiance.square().sum();
  }
  return norm > 0 ? std::sqrt(noise / norm) : 0;
}

/// Those above `area`, and above `near_area` where something stands on them.
void DivideUnseen(OutputMesh& mesh, double area, double near_area) {
  const Hierarchy& hierarchy = mesh.hierarchy();
  const auto is_unseen = [&](Index e) {
    return mesh.IsLit(e) &&
           (hierarchy[e].area > area || (hierarchy[e].area > near_area && StandsSomethingOn(hierarchy, e)));
  };
  for (std::size_t k = 0; k < mesh.cut().size(); ++k) {
    while (is_unseen(mesh.cut()[k])) {
      mesh.Divide(k);
    }
  }
}

/// As many times the rays, within reason, as this noise asks for.
double MoreRays(const OutputMesh& mesh, double noise, double asked) {
  constexpr double kMost = 64;
  return std::min(std::pow(noise / asked, 2), kMost / mesh.effort());
}

MeshSummary DivideWhereItMatters(OutputMesh& mesh, const MeshOptions& options) {
  const double area = mesh.hierarchy().patches().area;
  MeshSummary summary;
  const std::function<bool()> stop = [&] {
    return options.stop && options.stop(summary.error, mesh.vertex_count());
  };
  const auto ended = [&](MeshEnd end) {
    summary.end = end;
    return summary;
  };
  // By rays, what the mesh finds is finer than the solution, and becomes the light of the next round: an
  // error of the solution's is reflected once more each time. Many vertices' rays come together in each of
  // that, so a few do until the last.
  const bool by_rays = mesh.gatherer().IsByRays();
  constexpr int kOwnLight = 2;
  constexpr double kFewRays = 0.25;
  int own_light = 0;
  if (by_rays) {
    mesh.GatherAnew(kFewRays);
  }
  // The input's own vertices are the least that there is to give.
  if (!mesh.Gather(stop)) {
    mesh.Gather({}, OutputMesh::Source::kSolution);
    return ended(MeshEnd::kStopped);
  }
  // Coarse first, so that there is always something even to show when time is short.
  constexpr double kFirstUnseen = 1e-2;
  constexpr double kUnseenFall = 4;
  double unseen = std::max(kFirstUnseen, options.start_area);
  DivideUnseen(mesh, unseen * area, unseen * area);
  double left = 0;           // of the squared errors, that of the elements that the last round let be
  double divided_error = 0;  // and that of those that it divided
  int in_vain = 0;
  while (true) {
    if (!mesh.Gather(stop)) {
      return ended(MeshEnd::kStopped);
    }
    const MeshError error = ErrorOf(mesh);
    summary.error = error.interpolation;
    summary.noise = error.noise;
    const double more = MoreRays(mesh, error.noise, options.noise);
    if (unseen > options.start_area) {
      constexpr double kWorth = 1.1;
      if (more > kWorth && !by_rays) {
        mesh.GatherAnew(more);
      }
      unseen = std::max(unseen / kUnseenFall, options.start_area);
      DivideUnseen(mesh, unseen * area, (unseen > options.start_area ? unseen : options.near_area) * area);
      continue;
    }
    if (by_rays && own_light < kOwnLight) {
      mesh.TakeOwnLight();
      mesh.GatherAnew(++own_light < kOwnLight ? 1 : more);
      continue;
    }
    if (error.interpolation <= options.error) {
      constexpr double kLittle = 1.02;
      if (more > kLittle) {
        mesh.GatherAnew(more);
        continue;
      }
      return ended(error.noise < kLittle * options.noise ? MeshEnd::kError : MeshEnd::kLimit);
    }
    if (mesh.vertex_count() >= options.max_vertices) {
      return ended(MeshEnd::kLimit);
    }
    const double total = std::accumulate(error.squared.begin(), error.squared.end(), 0.0);
    // What division does not lower, again and again, is no curvature but the rays' noise, and would be
    // divided for ever. (Once it may have found a peak.)
    constexpr double kNoise = 0.85;
    constexpr int kOften = 3;
    in_vain = divided_error > 0 && total - left > kNoise * divided_error ? in_vain + 1 : 0;
    if (in_vain == kOften) {
      return ended(MeshEnd::kLimit);
    }
    // Worst first, until the target is met: by the others and what division leaves of these (a half at a
    // shadow's edge, less elsewhere), or by a part of it from the others alone.
    constexpr double kLeft = 0.3;
    constexpr double kStays = 0.4;
    std::vector<std::size_t> order(mesh.cut().size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
      return error.squared[a] != error.squared[b] ? error.squared[a] > error.squared[b] : a < b;
    });
    left = total;
    const double allowed = total * std::pow(options.error / error.interpolation, 2);
    const double goal = std::max(kLeft * allowed, (allowed - kStays * total) / (1 - kStays));
    bool divided = false;
    for (const std::size_t k : order) {
      if (left <= goal) {
        break;
      }
      left -= error.squared[k];
      if (mesh.hierarchy()[mesh.cut()[k]].area > options.min_area * area) {
        mesh.Divide(k);
        divided = true;
      }
    }
    if (!divided) {
      return ended(MeshEnd::kLimit);
    }
    divided_error = total - left;
  }
}

}  // namespace

MeshSummary RefineMesh(OutputMesh& mesh, const MeshOptions& options) {
  MeshSummary summary = DivideWhereItMatters(mesh, options);
  if (mesh.gatherer().IsByRays()) {
    SmoothNoise(mesh);
    summary.noise = NoiseOf(mesh);
  }
  mesh.CoverSealed();
  return summary;
}

MeshSummary TakeSolution(OutputMesh& mesh) {
  for (std::size_t k = 0; k < mesh.cut().size();) {
    if (!mesh.IsLit(mesh.cut()[k]) || mesh.gatherer().IsSolverLeaf(mesh.cut()[k])) {
      ++k;
    } else {
      mesh.Divide(k);
    }
  }
  if (mesh.gatherer().IsCurved()) {
    const std::size_t leaves = mesh.cut().size();
    for (std::size_t k = 0; k < leaves; ++k) {
      if (mesh.IsLit(mesh.cut()[k])) {
        mesh.Divide(k);
      }
    }
  }
  mesh.Gather({}, OutputMesh::Source::kSolution);
  const MeshError error = ErrorOf(mesh);
  mesh.CoverSealed();
  return {.end = MeshEnd::kError, .error = error.interpolation, .noise = error.noise};
}

}  // namespace radbake
