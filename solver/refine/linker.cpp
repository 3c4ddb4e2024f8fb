#include "solver/refine/linker.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>

#include "solver/transport/form_factor.h"
#include "solver/transport/sampling.h"

namespace radbake {
namespace {

template <typename Body>
void ParallelFor(std::size_t count, const Body& body) {
  constexpr std::size_t kGrain = 64;
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, kGrain), [&](const auto& range) {
    for (std::size_t k = range.begin(); k != range.end(); ++k) {
      body(k);
    }
  });
}

/// Does each reach in front of the other's plane by more than positions are exact? The two sides of one
/// surface, and neighbours in one plane, do not.
bool FaceOneAnother(const Polygon& a, const Polygon& b, double tolerance) {
  const auto reaches = [&](const Polygon& polygon, const Plane& plane) {
    for (int k = 0; k < polygon.count; ++k) {
      if (plane.Distance(polygon[k]) > tolerance) {
        return true;
      }
    }
    return false;
  };
  return reaches(a, PlaneOf(b)) && reaches(b, PlaneOf(a));
}

void AppendLive(std::vector<Link>& links, std::span<const Link> candidates) {
  std::copy_if(candidates.begin(), candidates.end(), std::back_inserter(links),
               [](const Link& link) { return link.form_factor > 0; });
}

}  // namespace

void Linker::MeasureVariation(Link& link, const Polygon& receiver, const Polygon& shooter) const {
  // A hair inside, since the limit at a shared edge depends on the side that one comes from.
  constexpr double kInside = 1e-4;
  const Vec3 centroid = receiver.Centroid();
  double low = PointToPolygon(centroid, receiver.normal, shooter);
  double high = low;
  const auto look = [&](const Vec3& x) {
    const double f = PointToPolygon(x + kInside * (centroid - x), receiver.normal, shooter);
    low = std::min(low, f);
    high = std::max(high, f);
  };
  for (int k = 0; k < receiver.count; ++k) {
    look(receiver[k]);
  }
  // A small shooter close above a large receiver is seen from below it alone.
  look(NearestPoint(receiver, shooter.Centroid()));
  link.variation = static_cast<float>(high - low);
}

void Linker::Measure(Link& link) const {
  const Polygon receiver = hierarchy_.Shape(link.receiver);
  const Polygon shooter = hierarchy_.Shape(link.shooter);
  const double exchange_area = ExchangeArea(receiver, shooter);
  link.form_factor = static_cast<float>(exchange_area / hierarchy_[link.receiver].area);
  if (!(link.form_factor > 0)) {
    return;
  }
  MeasureVariation(link, receiver, shooter);
  link.clear = link.clear || visibility_.Clear(receiver, shooter);
  if (link.clear) {
    link.visibility = link.judged = 1;
  } else {
    const std::uint64_t key = Hash((static_cast<std::uint64_t>(link.receiver) << 32U) | link.shooter);
    const SampledVisibility sampled =
        visibility_.BetweenElements(receiver, shooter, exchange_area, key, rays_);
    link.visibility = static_cast<float>(sampled.carried);
    link.judged = static_cast<float>(sampled.judged);
  }
}

void Linker::LinkPatches() {
  const auto count = static_cast<Index>(hierarchy_.root_count());
  std::vector<std::vector<Link>> rows(count);
  std::vector<Polygon> shapes;
  shapes.reserve(count);
  for (Index root = 0; root < count; ++root) {
    shapes.push_back(hierarchy_.Shape(root));
  }
  tbb::parallel_for(Index{0}, count, [&](Index receiver) {
    for (Index shooter = 0; shooter < count; ++shooter) {
      Link link{receiver, shooter};
      if (receiver != shooter &&
          FaceOneAnother(shapes[receiver], shapes[shooter], hierarchy_.patches().weld)) {
        Measure(link);
        AppendLive(rows[receiver], {&link, 1});
      }
    }
  });
  std::vector<Link> links;
  for (const auto& row : rows) {
    links.insert(links.end(), row.begin(), row.end());
  }
  links_.Assign(links, hierarchy_.size());
}

std::size_t Linker::Refine(const Oracle& oracle, const std::function<bool()>& stop) {
  std::vector<Link> kept;
  std::vector<Link> open(links_.all().begin(), links_.all().end());
  std::size_t replaced = 0;
  while (!open.empty()) {
    if (stop && stop()) {
      kept.insert(kept.end(), open.begin(), open.end());
      break;
    }
    std::vector<Decision> decisions(open.size());
    ParallelFor(open.size(), [&](std::size_t k) { decisions[k] = oracle.Judge(hierarchy_, open[k]); });
    // One thread divides, in the links' order, so that elements are numbered the same on any number of
    // threads.
    std::vector<Link> next;
    for (std::size_t k = 0; k < open.size(); ++k) {
      const Link& link = open[k];
      if (decisions[k] == Decision::kKeep) {
        kept.push_back(link);
        continue;
      }
      ++replaced;
      const bool receiver = decisions[k] == Decision::kDivideReceiver;
      const Index first = hierarchy_.Divide(receiver ? link.receiver : link.shooter);
      for (Index child = first; child < first + 4; ++child) {
        Link& refined = next.emplace_back(link);
        (receiver ? refined.receiver : refined.shooter) = child;
      }
    }
    ParallelFor(next.size(), [&](std::size_t k) { Measure(next[k]); });
    open.clear();
    AppendLive(open, next);
  }
  links_.Assign(kept, hierarchy_.size());
  return replaced;
}

}  // namespace radbake
