#include "solver/bake/output_mesh.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <utility>

#include "solver/bake/neighbourhood.h"
#include "solver/transport/sampling.h"

namespace radbake {
namespace {

// Mean square of the interpolation error over an element, in squares of how far the centre is from what the
// corners say: where a shadow's edge crosses the element, and where irradiance is smooth.
constexpr double kEdge = 0.4;
constexpr double kSmooth = 1.0 / 30;

// Of the rays' variance at the centre and the corners together, what is left of it between them.
constexpr double kNoiseLeft = 0.5;

Vec3 ElementCentre(const Hierarchy& hierarchy, Index element) {
  const Polygon shape = hierarchy.Shape(element);
  const std::array<float, 4> weight = CentreWeights(hierarchy[element]);
  Vec3 centre = Vec3::Zero();
  for (int k = 0; k < shape.count; ++k) {
    centre += static_cast<double>(weight[static_cast<std::size_t>(k)]) * shape[k];
  }
  return centre;
}

/// Calls body(k) for all k on all threads, asking `stop` on this one now and then. False if it stopped.
template <typename Body>
bool ForEach(std::size_t count, const std::function<bool()>& stop, const Body& body) {
  constexpr std::size_t kChunk = 64;
  constexpr std::size_t kGrain = 8;
  for (std::size_t begin = 0; begin < count; begin += kChunk) {
    if (stop && stop()) {
      return false;
    }
    tbb::parallel_for(tbb::blocked_range<std::size_t>(begin, std::min(count, begin + kChunk), kGrain),
                      [&](const auto& range) {
                        for (std::size_t k = range.begin(); k != range.end(); ++k) {
                          body(k);
                        }
                      });
  }
  return true;
}

/// The irradiance of the open neighbours of a sealed place.
class Neighbours {
 public:
  void Add(const Rgb& irradiance) {
    sum_ += irradiance;
    ++count_;
    if (Luminance(irradiance) < Luminance(darkest_)) {
      darkest_ = irradiance;
    }
    brightest_ = std::max(brightest_, Luminance(irradiance));
  }

  /// Zero if there are none.
  Rgb Cover() const {
    constexpr double kMuch = 2;
    if (count_ == 0) {
      return Rgb::Zero();
    }
    return brightest_ > kMuch * Luminance(darkest_) ? darkest_ : Rgb(sum_ / count_);
  }

 private:
  Rgb sum_ = Rgb::Zero();
  Rgb darkest_ = Rgb::Constant(std::numeric_limits<double>::infinity());
  double brightest_ = 0;
  int count_ = 0;
};

struct Meeting {
  Index vertex;
  Index element;
};

}  // namespace

OutputMesh::OutputMesh(Hierarchy& hierarchy, const Gatherer& gatherer, const Links& links, Hold hold)
    : hierarchy_(hierarchy),
      gatherer_(gatherer),
      hold_(std::move(hold)),
      lit_(hierarchy.surface_root_count(), false),
      cut_(hierarchy.surface_root_count()) {
  for (const Link& link : links.all()) {
    if (IsElement(link.receiver)) {
      lit_[hierarchy[link.receiver].patch] = true;
    }
  }
  for (Index patch = 0; patch < lit_.size(); ++patch) {
    lit_[patch] = lit_[patch] || gatherer.MayBeCovered(patch);
    for (Index c = hierarchy.clusters().Above(patch); c != kNone && !lit_[patch];
         c = hierarchy.clusters()[c].parent) {
      lit_[patch] = !links.Into(ClusterNode(c)).empty();
    }
  }
  std::iota(cut_.begin(), cut_.end(), Index{0});
}

void OutputMesh::GrowWithHierarchy() {
  at_vertex_.resize(hierarchy_.vertex_count());
  at_centre_.resize(hierarchy_.size());
}

void OutputMesh::Tell() const {
  // Of an element of the cut: itself and its vertices around, both twice; where they meet, while they are
  // gathered; its error and its place among them; and as it is emitted a vertex, by which it is found, and
  // two triangles. What grows by pushing back may have twice the room.
  constexpr std::size_t kLoop = sizeof(Index) + sizeof(Loop) + 8 * sizeof(Index) + 2 * sizeof(std::size_t);
  constexpr std::size_t kMeetings = 10 * sizeof(Meeting);
  constexpr std::size_t kPlace = 2 * (sizeof(double) + sizeof(std::size_t));
  constexpr std::size_t kEmitted = 2 * (sizeof(BakedVertex) + 2 * sizeof(Triangle)) + 6 * sizeof(void*);
  if (hold_) {
    hold_(hierarchy_.Bytes() + BytesOf(at_vertex_) + BytesOf(at_centre_) +
          cut_.size() * (2 * kLoop + kMeetings + kPlace + kEmitted));
  }
}

void OutputMesh::Divide(Index element) {
  constexpr std::size_t kOften = 4096;
  if (hierarchy_.size() % kOften < 4) {
    Tell();
  }
  const Index first = hierarchy_.Divide(element);
  GrowWithHierarchy();
  if (hierarchy_.DivisionOf(element) == Division::kSquare && at_centre_[element].gathered) {
    at_vertex_[hierarchy_[first].corner[2]] = at_centre_[element];
    ++gathered_;
  }
}

void OutputMesh::DivideUnseen(double area, double near_area) {
  const auto is_unseen = [&](Index e) {
    return IsLit(e) && (hierarchy_[e].area > area ||
                        (hierarchy_[e].area > near_area && StandsSomethingOn(hierarchy_, e)));
  };
  for (std::size_t k = 0; k < cut_.size(); ++k) {
    while (is_unseen(cut_[k])) {
      Divide(cut_[k]);
      const Index first = hierarchy_[cut_[k]].first_child;
      cut_[k] = first;
      cut_.insert(cut_.end(), {first + 1, first + 2, first + 3});
    }
  }
}

void OutputMesh::WalkEdge(Index from, Index to, Loop& loop) {
  const Index middle = hierarchy_.FindMidpoint(hierarchy_.PositionOf(from), hierarchy_.PositionOf(to));
  if (middle == kNone || middle >= used_.size() || !used_[middle]) {
    return;
  }
  const Index vertex = hierarchy_.MidVertex(from, to);
  WalkEdge(from, vertex, loop);
  loop.push_back(vertex);
  WalkEdge(vertex, to, loop);
}

void OutputMesh::WalkEdges() {
  Tell();
  used_.clear();
  for (const Index e : cut_) {
    const Element& element = hierarchy_[e];
    for (int k = 0; k < element.CornerCount(); ++k) {
      const Index position = hierarchy_.PositionOf(element.corner[static_cast<std::size_t>(k)]);
      if (position >= used_.size()) {
        used_.resize(2 * static_cast<std::size_t>(position) + 1, false);
      }
      used_[position] = true;
    }
  }
  loops_.assign(cut_.size(), {});
  for (std::size_t k = 0; k < cut_.size(); ++k) {
    const std::array<Index, 4> corner = hierarchy_[cut_[k]].corner;
    const auto count = static_cast<std::size_t>(hierarchy_[cut_[k]].CornerCount());
    for (std::size_t c = 0; c < count; ++c) {
      loops_[k].push_back(corner[c]);
      WalkEdge(corner[c], corner[(c + 1) % count], loops_[k]);
    }
  }
  GrowWithHierarchy();
}

bool OutputMesh::GatherVertices(const std::function<bool()>& stop, Source source) {
  std::vector<Meeting> meetings;
  for (std::size_t k = 0; k < cut_.size(); ++k) {
    for (const Index vertex : loops_[k]) {
      if (!at_vertex_[vertex].gathered) {
        meetings.push_back({vertex, cut_[k]});
      }
    }
  }
  std::sort(meetings.begin(), meetings.end(), [](const Meeting& a, const Meeting& b) {
    return a.vertex != b.vertex ? a.vertex < b.vertex : a.element < b.element;
  });
  std::vector<std::size_t> begin;
  for (std::size_t k = 0; k < meetings.size(); ++k) {
    if (k == 0 || meetings[k].vertex != meetings[k - 1].vertex) {
      begin.push_back(k);
    }
  }
  const std::size_t count = begin.size();
  gathered_ += count;
  begin.push_back(meetings.size());
  return ForEach(count, stop, [&](std::size_t v) {
    const Index vertex = meetings[begin[v]].vertex;
    Sample& sample = at_vertex_[vertex];
    sample.gathered = true;
    struct View {
      Vec3 x;
      Index leaf;
    };
    std::vector<View> views;
    bool sealed = false;
    for (std::size_t k = begin[v]; k < begin[v + 1]; ++k) {
      const Index element = meetings[k].element;
      if (!IsLit(element)) {
        continue;
      }
      // A hair inside the element: at a shared edge, form factors have a limit from each side.
      constexpr double kInside = 1e-4;
      const Vec3 x = hierarchy_.Point(vertex) +
                     kInside * (ElementCentre(hierarchy_, element) - hierarchy_.Point(vertex));
      const Index leaf = gatherer_.SolverLeaf(element, x);
      if (std::ranges::any_of(views,
                              [&](const View& view) { return gatherer_.SeesAlike(view.leaf, leaf); })) {
        continue;
      }
      if (source == Source::kRays ? gatherer_.IsSealed(x, leaf) : gatherer_.IsSealed(leaf)) {
        sealed = true;
        continue;
      }
      views.push_back({x, leaf});
    }
    sample.sealed = sealed && views.empty();
    // Rays that are shared err independently. Where they are not, the same random numbers are taken at the
    // same place: what errs at one errs at all.
    const double part = gatherer_.EffortOfPart(views.size());
    for (const View& view : views) {
      const Estimate estimate = At(view.x, view.leaf, Hash(vertex), source, part * effort_);
      sample.irradiance += estimate.irradiance / static_cast<double>(views.size());
      sample.variance += part * estimate.variance / static_cast<double>(views.size());
    }
  });
}

bool OutputMesh::GatherCentres(const std::function<bool()>& stop, Source source) {
  return ForEach(cut_.size(), stop, [&](std::size_t k) {
    const Index e = cut_[k];
    Sample& sample = at_centre_[e];
    if (std::exchange(sample.gathered, true) || !IsLit(e)) {
      return;
    }
    // A hair off the centre, which may lie on an edge of a younger element of the solver's.
    constexpr double kOff = 1e-4;
    const Polygon shape = hierarchy_.Shape(e);
    const Vec3 centre = ElementCentre(hierarchy_, e);
    const Vec3 x = centre + kOff * (0.6 * (shape[0] - centre) + 0.4 * (shape[1] - centre));
    const Index leaf = gatherer_.SolverLeaf(e, x);
    sample.sealed = source == Source::kRays ? gatherer_.IsSealed(x, leaf) : gatherer_.IsSealed(leaf);
    if (!sample.sealed) {
      const Estimate estimate = At(x, leaf, Hash(~static_cast<std::uint64_t>(e)), source, effort_);
      sample.irradiance = estimate.irradiance;
      sample.variance = estimate.variance;
    }
  });
}

Estimate OutputMesh::At(const Vec3& x, Index leaf, std::uint64_t key, Source source, double effort) const {
  return source == Source::kRays ? gatherer_.Irradiance(x, leaf, key, effort)
                                 : Estimate{gatherer_.Solved(leaf, x)};
}

OutputMesh::Deviation OutputMesh::DeviationOf(Index e) const {
  const Element& element = hierarchy_[e];
  const auto count = static_cast<std::size_t>(element.CornerCount());
  Deviation result;
  result.noise = at_centre_[e].variance;
  for (std::size_t c = 0; c < count; ++c) {
    const Sample& corner = at_vertex_[element.corner[c]];
    result.mean += corner.irradiance / static_cast<double>(count);
    result.noise += corner.variance / static_cast<double>(count * count);
  }
  result.squared = (at_centre_[e].irradiance - result.mean).square().sum();
  return result;
}

double OutputMesh::ErrorPerDeviation(Index e, const Deviation& deviation) const {
  const Index parent = hierarchy_[e].parent;
  if (parent == kNone || !at_centre_[parent].gathered) {
    return kEdge;
  }
  const Deviation above = DeviationOf(parent);
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

std::vector<double> OutputMesh::SquaredErrors() {
  std::vector<double> errors(cut_.size());
  double norm = 0;
  double interpolation = 0;
  double noise = 0;
  for (std::size_t k = 0; k < cut_.size(); ++k) {
    const Deviation deviation = DeviationOf(cut_[k]);
    const double area = hierarchy_[cut_[k]].area;
    const double share = area * ErrorPerDeviation(cut_[k], deviation);
    // What the rays' noise adds to the deviation of many, it does not add to the error of interpolation.
    errors[k] = share * std::max(0.0, deviation.squared - deviation.noise);
    interpolation += share * (deviation.squared - deviation.noise);
    noise += kNoiseLeft * area * deviation.noise;
    norm += area * deviation.mean.square().sum();
  }
  error_ = norm > 0 ? std::sqrt(std::max(0.0, interpolation) / norm) : 0;
  noise_ = norm > 0 ? std::sqrt(noise / norm) : 0;
  return errors;
}

void OutputMesh::SpendAsNeeded(double noise) {
  constexpr double kMost = 64;
  constexpr double kWorth = 1.5;
  const double effort = std::clamp(std::pow(noise_ / noise, 2), 0.5, kMost / effort_);
  if (effort < kWorth) {
    return;
  }
  effort_ *= effort;
  std::ranges::fill(at_vertex_, Sample{});
  std::ranges::fill(at_centre_, Sample{});
  gathered_ = 0;
}

void OutputMesh::CoverSealed() {
  std::map<Index, Neighbours> by_vertex;
  for (std::size_t k = 0; k < cut_.size(); ++k) {
    Sample& centre = at_centre_[cut_[k]];
    const Loop& loop = loops_[k];
    const bool fan = loop.size() > 3;
    Neighbours of_centre;
    for (std::size_t v = 0; v < loop.size(); ++v) {
      if (!at_vertex_[loop[v]].sealed) {
        of_centre.Add(at_vertex_[loop[v]].irradiance);
        continue;
      }
      Neighbours& neighbours = by_vertex[loop[v]];
      for (const std::size_t other : {(v + 1) % loop.size(), (v + loop.size() - 1) % loop.size()}) {
        if (!at_vertex_[loop[other]].sealed) {
          neighbours.Add(at_vertex_[loop[other]].irradiance);
        }
      }
      if (fan && !centre.sealed) {
        neighbours.Add(centre.irradiance);
      }
    }
    if (centre.sealed) {
      centre.irradiance = of_centre.Cover();
    }
  }
  for (const auto& [vertex, neighbours] : by_vertex) {
    at_vertex_[vertex].irradiance = neighbours.Cover();
  }
}

MeshEnd OutputMesh::Refine(const MeshOptions& options) {
  const MeshEnd end = DivideWhereItMatters(options);
  CoverSealed();
  return end;
}

void OutputMesh::TakeSolution() {
  for (std::size_t k = 0; k < cut_.size();) {
    if (!IsLit(cut_[k]) || gatherer_.IsSolverLeaf(cut_[k])) {
      ++k;
      continue;
    }
    const Index first = hierarchy_[cut_[k]].first_child;
    cut_[k] = first;
    cut_.insert(cut_.end(), {first + 1, first + 2, first + 3});
  }
  if (gatherer_.IsCurved()) {
    const std::vector<Index> leaves = std::exchange(cut_, {});
    for (const Index leaf : leaves) {
      if (IsLit(leaf)) {
        Divide(leaf);
        const Index first = hierarchy_[leaf].first_child;
        cut_.insert(cut_.end(), {first, first + 1, first + 2, first + 3});
      } else {
        cut_.push_back(leaf);
      }
    }
  }
  GrowWithHierarchy();
  WalkEdges();
  GatherVertices({}, Source::kSolution);
  GatherCentres({}, Source::kSolution);
  SquaredErrors();
  CoverSealed();
}

MeshEnd OutputMesh::DivideWhereItMatters(const MeshOptions& options) {
  const double area = hierarchy_.patches().area;
  const std::function<bool()> stop = [&] { return options.stop && options.stop(error_, gathered_); };
  // The input's own vertices are the least that there is to give.
  WalkEdges();
  if (!GatherVertices(stop) || !GatherCentres(stop)) {
    GatherVertices({}, Source::kSolution);
    GatherCentres({}, Source::kSolution);
    return MeshEnd::kStopped;
  }
  std::vector<Index> last_cut = cut_;
  std::vector<Loop> last_loops = loops_;
  // Coarse first, so that there is always something even to show when time is short.
  constexpr double kFirstUnseen = 1e-2;
  constexpr double kUnseenFall = 4;
  double unseen = std::max(kFirstUnseen, options.start_area);
  DivideUnseen(unseen * area, unseen * area);
  double left = 0;           // of the squared errors, that of the elements that the last round let be
  double divided_error = 0;  // and that of those that it divided
  int in_vain = 0;
  while (true) {
    WalkEdges();
    if (!GatherVertices(stop) || !GatherCentres(stop)) {
      cut_ = std::move(last_cut);
      loops_ = std::move(last_loops);
      return MeshEnd::kStopped;
    }
    last_cut = cut_;
    last_loops = loops_;
    const std::vector<double> errors = SquaredErrors();
    if (unseen > options.start_area) {
      SpendAsNeeded(options.noise);
      unseen = std::max(unseen / kUnseenFall, options.start_area);
      DivideUnseen(unseen * area, (unseen > options.start_area ? unseen : options.near_area) * area);
      continue;
    }
    if (error_ <= options.error) {
      return MeshEnd::kError;
    }
    if (gathered_ >= options.max_vertices) {
      return MeshEnd::kLimit;
    }
    const double total = std::accumulate(errors.begin(), errors.end(), 0.0);
    // What division does not lower, again and again, is no curvature but the rays' noise, and would be
    // divided for ever. (Once it may have found a peak.)
    constexpr double kNoise = 0.85;
    constexpr int kOften = 3;
    in_vain = divided_error > 0 && total - left > kNoise * divided_error ? in_vain + 1 : 0;
    if (in_vain == kOften) {
      return MeshEnd::kLimit;
    }
    // Worst first, until the target is met: by the others and what division leaves of these (a half at a
    // shadow's edge, less elsewhere), or by a part of it from the others alone.
    constexpr double kLeft = 0.3;
    constexpr double kStays = 0.4;
    std::vector<std::size_t> order(cut_.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
      return errors[a] != errors[b] ? errors[a] > errors[b] : a < b;
    });
    left = total;
    const double allowed = total * std::pow(options.error / error_, 2);
    const double goal = std::max(kLeft * allowed, (allowed - kStays * total) / (1 - kStays));
    bool divided = false;
    for (const std::size_t k : order) {
      if (left <= goal) {
        break;
      }
      left -= errors[k];
      const Index e = cut_[k];
      if (hierarchy_[e].area > options.min_area * area) {
        Divide(e);
        const Index first = hierarchy_[e].first_child;
        cut_[k] = first;
        cut_.insert(cut_.end(), {first + 1, first + 2, first + 3});
        divided = true;
      }
    }
    if (!divided) {
      return MeshEnd::kLimit;
    }
    divided_error = total - left;
  }
}

}  // namespace radbake
