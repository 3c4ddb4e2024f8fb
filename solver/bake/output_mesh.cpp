#include "solver/bake/output_mesh.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <utility>

#include "solver/bake/element_centre.h"
#include "solver/transport/sampling.h"

namespace radbake {
namespace {

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
    hold_(hierarchy_.Bytes() + BytesOf(at_vertex_) + BytesOf(at_centre_) + BytesOf(finished_at_vertex_) +
          BytesOf(finished_at_centre_) + (light_ ? light_->Bytes() : 0) +
          cut_.size() * (2 * kLoop + kMeetings + kPlace + kEmitted));
  }
}

void OutputMesh::Divide(std::size_t k) {
  constexpr std::size_t kOften = 4096;
  if (hierarchy_.size() % kOften < 4) {
    Tell();
  }
  const Index element = cut_[k];
  const Index first = hierarchy_.Divide(element);
  GrowWithHierarchy();
  if (hierarchy_[element].division == Division::kSquare && at_centre_[element].gathered) {
    at_vertex_[hierarchy_[first].corner[2]] = at_centre_[element];
    ++gathered_;
  }
  cut_[k] = first;
  cut_.insert(cut_.end(), {first + 1, first + 2, first + 3});
}

bool OutputMesh::Gather(const std::function<bool()>& stop, Source source) {
  WalkEdges();
  if (!GatherVertices(stop, source) || !GatherCentres(stop, source)) {
    if (!finished_cut_.empty()) {
      cut_ = finished_cut_;
      loops_ = finished_loops_;
    }
    if (!finished_at_vertex_.empty()) {
      at_vertex_ = std::move(finished_at_vertex_);
      at_centre_ = std::move(finished_at_centre_);
      GrowWithHierarchy();
    }
    return false;
  }
  finished_cut_ = cut_;
  finished_loops_ = loops_;
  finished_at_vertex_ = {};
  finished_at_centre_ = {};
  return true;
}

void OutputMesh::GatherAnew(double factor) {
  effort_ *= factor;
  finished_at_vertex_ = std::exchange(at_vertex_, {});
  finished_at_centre_ = std::exchange(at_centre_, {});
  GrowWithHierarchy();
  gathered_ = 0;
}

void OutputMesh::TakeOwnLight() {
  const Rgb unseen = Rgb::Constant(std::numeric_limits<double>::quiet_NaN());
  std::vector<Rgb> at_vertex;
  at_vertex.reserve(at_vertex_.size());
  for (const Sample& sample : at_vertex_) {
    at_vertex.push_back(sample.sealed ? unseen : sample.irradiance);
  }
  std::vector<Rgb> at_centre;
  at_centre.reserve(cut_.size());
  for (const Index e : cut_) {
    at_centre.push_back(at_centre_[e].sealed ? unseen : at_centre_[e].irradiance);
  }
  light_.emplace(hierarchy_, cut_, std::move(at_vertex), std::move(at_centre));
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
      const Vec3 x = InsideNear(hierarchy_, element, hierarchy_.Point(vertex));
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
    const Vec3 x = InsideNear(hierarchy_, e, ElementCentre(hierarchy_.Shape(e)));
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
  return source == Source::kRays ? gatherer_.Irradiance(x, leaf, key, effort, light_ ? &*light_ : nullptr)
                                 : Estimate{gatherer_.Solved(leaf, x)};
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

}  // namespace radbake
