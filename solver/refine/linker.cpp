#include "solver/refine/linker.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <numeric>
#include <utility>

#include "solver/transport/coupling.h"
#include "solver/transport/form_factor.h"
#include "solver/transport/node_transport.h"
#include "solver/transport/sampling.h"
#include "solver/transport/seen_polygon.h"

namespace radbake {
namespace {

// Of how much a form factor varies: the oracle asks no more.
constexpr double kVariationTolerance = 1e-2;

constexpr std::size_t kChunk = 2048;  // links between two looks at the clock

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
               [](const Link& link) { return link.form_factor > 0 || link.variation > 0; });
}

std::uint64_t KeyOf(const Link& link) {
  return Hash((static_cast<std::uint64_t>(link.receiver) << 32U) | link.shooter);
}

void Take(const SampledVisibility& sampled, Link& link) {
  link.visibility = static_cast<float>(sampled.carried);
  link.judged = static_cast<float>(sampled.judged);
}

}  // namespace

Linker::Linker(Hierarchy& hierarchy, const Visibility& visibility, int visibility_rays, int direct_rays,
               BasisOrder order)
    : hierarchy_(hierarchy),
      visibility_(visibility),
      rays_(visibility_rays),
      direct_rays_(direct_rays),
      tolerance_(FormFactorTolerance(hierarchy.patches())),
      basis_(order) {
  for (Index root = 0; root < hierarchy.surface_root_count(); ++root) {
    mean_emission_ +=
        hierarchy[root].area / hierarchy.patches().area * Luminance(hierarchy.PatchOf(root).emission);
  }
}

int Linker::RaysFrom(Index shooter) const {
  const int most = direct_rays_ / rays_;
  const double emission = Luminance(hierarchy_.PatchOf(shooter).emission);
  if (emission > 0 && emission >= most * mean_emission_) {
    return std::max(rays_, most * rays_);
  }
  return emission > mean_emission_ ? static_cast<int>(emission / mean_emission_) * rays_ : rays_;
}

template <typename Kernel>
double Linker::Variation(Index receiver, const Vec3& nearest, const Kernel& kernel) const {
  // A hair inside, since the limit at a shared edge depends on the side that one comes from.
  constexpr double kInside = 1e-4;
  const Polygon shape = hierarchy_.Shape(receiver);
  const Vec3 centroid = shape.Centroid();
  BasisValues moments{};
  if (basis_.count() > 1) {
    moments = MomentsOver({hierarchy_, basis_, receiver}, kernel);
  }
  const auto left_over = [&](const Vec3& x) {
    double value = kernel(x);
    if (basis_.count() > 1) {
      const BasisValues values = basis_[receiver].At(x);
      for (std::size_t i = 1; i < basis_.count(); ++i) {
        value -= moments[i] * values[i];
      }
    }
    return value;
  };
  double low = left_over(centroid);
  double high = low;
  const auto look = [&](const Vec3& x) {
    const double value = left_over(x + kInside * (centroid - x));
    low = std::min(low, value);
    high = std::max(high, value);
  };
  for (int k = 0; k < shape.count; ++k) {
    look(shape[k]);
  }
  // A small shooter close above a large receiver is seen from below it alone.
  look(nearest);
  return high - low;
}

void Linker::Measure(Link& link) const {
  link.source_count = link.receiver_count = 0;
  if (IsElement(link.receiver) && IsElement(link.shooter)) {
    MeasureElements(link);
  } else {
    MeasureNodes(link);
  }
}

void Linker::MeasureElements(Link& link) const {
  const Polygon receiver = hierarchy_.Shape(link.receiver);
  const SeenPolygon seen(hierarchy_.Shape(link.shooter));
  const Polygon& shooter = seen.shape();
  // What is below two patches that face one another need not be asked again.
  const bool roots = hierarchy_[link.receiver].parent == kNone || hierarchy_[link.shooter].parent == kNone;
  link.form_factor = link.judged_factor = 0;
  link.variation = 0;
  link.carried = true;
  if (roots && !FaceOneAnother(receiver, shooter, hierarchy_.patches().weld)) {
    return;
  }
  const double area = hierarchy_[link.receiver].area;
  // The sky is so far that the middle sees what all of the receiver does; the contour integral would lose
  // digits.
  const double exchange_area = hierarchy_.IsSky(link.shooter)
                                   ? area * seen.From(receiver.Centroid(), receiver.normal)
                                   : ExchangeArea(receiver, shooter, tolerance_);
  link.form_factor = link.judged_factor = static_cast<float>(exchange_area / area);
  if (!(link.form_factor > 0)) {
    return;
  }
  link.variation = static_cast<float>(
      Variation(link.receiver, NearestPoint(receiver, shooter.Centroid()),
                [&](const Vec3& x) { return seen.From(x, receiver.normal, kVariationTolerance); }));
  link.clear = link.clear || visibility_.Clear(receiver, shooter);
  if (link.clear) {
    link.visibility = link.judged = 1;
  } else {
    Take(visibility_.BetweenElements(receiver, shooter, exchange_area, KeyOf(link), RaysFrom(link.shooter)),
         link);
  }
}

void Linker::MeasureNodes(Link& link) const {
  const NodeTransport sampled =
      BetweenNodes(hierarchy_, visibility_, link.receiver, link.shooter, KeyOf(link), rays_ / 2);
  link.form_factor = link.judged_factor = static_cast<float>(sampled.form_factor);
  link.variation = static_cast<float>(sampled.variation);
  if (basis_.count() > 1 && IsElement(link.receiver) && IsPunctual(link.shooter)) {
    const Polygon receiver = hierarchy_.Shape(link.receiver);
    const PunctualLight& light = hierarchy_.patches().lights[link.shooter - kFirstPunctual];
    link.variation = static_cast<float>(
        Variation(link.receiver, NearestPoint(receiver, light.position),
                  [&](const Vec3& x) { return UnoccludedAt(hierarchy_, x, receiver.normal, link.shooter); }));
  }
  link.clear = IsElement(link.receiver) && IsPunctual(link.shooter) &&
               (link.clear || ClearToLight(visibility_, hierarchy_.Shape(link.receiver),
                                           hierarchy_.patches().lights[link.shooter - kFirstPunctual]));
  link.visibility = link.clear ? 1 : static_cast<float>(sampled.visibility);
  // To and from clusters all rays may have missed what one of them would have found. Links between wide ones
  // that nothing was found on would be kept, and carry far too much by chance.
  link.judged =
      std::max(link.visibility,
               IsPunctual(link.shooter) && IsElement(link.receiver) ? 0 : 2 / static_cast<float>(rays_));
  link.carried = link.clear;
}

bool Linker::CarryAll(std::span<Link> links, const std::function<bool()>& stop) {
  for (std::size_t begin = 0; begin < links.size(); begin += kChunk) {
    if (begin > 0 && stop && stop()) {
      return false;
    }
    const std::span<Link> chunk = links.subspan(begin, std::min(kChunk, links.size() - begin));
    std::vector<NodeTransport> carried(chunk.size());
    ParallelFor(chunk.size(), [&](std::size_t k) {
      Link& link = chunk[k];
      if (!link.carried) {
        carried[k] =
            BetweenNodes(hierarchy_, visibility_, link.receiver, link.shooter, Hash(KeyOf(link)), 2 * rays_);
        link.form_factor = static_cast<float>(carried[k].form_factor);
        link.visibility = static_cast<float>(carried[k].visibility);
      }
    });
    for (std::size_t k = 0; k < chunk.size(); ++k) {
      if (!chunk[k].carried) {
        chunk[k].carried = true;
        chunk[k].first_share = static_cast<Index>(shares_.size());
        chunk[k].source_count = static_cast<std::uint16_t>(carried[k].sources.size());
        chunk[k].receiver_count = static_cast<std::uint16_t>(carried[k].receivers.size());
        shares_.insert(shares_.end(), carried[k].sources.begin(), carried[k].sources.end());
        shares_.insert(shares_.end(), carried[k].receivers.begin(), carried[k].receivers.end());
      }
    }
  }
  return true;
}

void Linker::Tell(std::size_t bytes) const {
  if (hold_) {
    hold_(bytes + BytesOfElements() + links_.Bytes() + BytesOf(shares_));
  }
}

void Linker::Assign(std::vector<Link>& links) {
  Tell(BytesOf(links) + links.size() * sizeof(Link) + BytesOf(shares_));
  std::vector<PatchShare> shares;
  for (Link& link : links) {
    const std::size_t count = std::size_t{link.source_count} + link.receiver_count;
    const auto own = std::span(shares_).subspan(link.first_share, count);
    link.first_share = static_cast<Index>(shares.size());
    shares.insert(shares.end(), own.begin(), own.end());
  }
  shares_.clear();
  links_.Assign(links, hierarchy_.size(), hierarchy_.clusters().size(), std::move(shares));
}

void Linker::LinkRoots() {
  basis_.Extend(hierarchy_);
  const auto surfaces = static_cast<Index>(hierarchy_.surface_root_count());
  const auto count = static_cast<Index>(hierarchy_.root_count());
  const auto lights = static_cast<Index>(hierarchy_.patches().lights.size());
  std::vector<Index> receivers(hierarchy_.clusters().empty() ? surfaces : 1, ClusterNode(0));
  std::vector<Index> shooters;
  if (hierarchy_.clusters().empty()) {
    std::iota(receivers.begin(), receivers.end(), Index{0});
    shooters = receivers;
  } else {
    shooters.push_back(ClusterNode(0));
  }
  for (Index sky = surfaces; sky < count; ++sky) {
    shooters.push_back(sky);
  }
  for (Index light = 0; light < lights; ++light) {
    shooters.push_back(PunctualNode(light));
  }
  constexpr std::size_t kRows = 256;  // between two looks at the memory
  std::vector<Link> links;
  for (std::size_t begin = 0; begin < receivers.size(); begin += kRows) {
    std::vector<std::vector<Link>> rows(std::min(kRows, receivers.size() - begin));
    tbb::parallel_for(std::size_t{0}, rows.size(), [&](std::size_t row) {
      const Index receiver = receivers[begin + row];
      for (const Index shooter : shooters) {
        Link link{receiver, shooter};
        if (receiver != shooter || IsCluster(shooter)) {
          Measure(link);
          AppendLive(rows[row], {&link, 1});
        }
      }
    });
    for (const auto& row : rows) {
      links.insert(links.end(), row.begin(), row.end());
    }
    Tell(BytesOf(links));
  }
  measured_ += receivers.size() * shooters.size();
  Assign(links);
}

void Linker::Replace(const Link& link, Decision decision, std::vector<Link>& next) {
  const auto children = [&](Index node) {
    if (IsCluster(node)) {
      const std::span<const Index> below = hierarchy_.clusters().Children(node - kFirstCluster);
      return std::vector<Index>(below.begin(), below.end());
    }
    const Index first = hierarchy_.Divide(node);
    return std::vector<Index>{first, first + 1, first + 2, first + 3};
  };
  const auto add = [&](Index receiver, Index shooter) {
    // A patch does not see itself, a cluster may.
    if (receiver != shooter || IsCluster(receiver)) {
      Link& refined = next.emplace_back(link);
      refined.receiver = receiver;
      refined.shooter = shooter;
    }
  };
  if (link.receiver == link.shooter) {
    const std::vector<Index> below = children(link.receiver);
    for (const Index receiver : below) {
      for (const Index shooter : below) {
        add(receiver, shooter);
      }
    }
  } else if (decision == Decision::kDivideReceiver) {
    for (const Index child : children(link.receiver)) {
      add(child, link.shooter);
    }
  } else {
    for (const Index child : children(link.shooter)) {
      add(link.receiver, child);
    }
  }
}

std::size_t Linker::CountOfReplaced(const Link& link, Decision decision) const {
  const auto children = [&](Index node) {
    return IsCluster(node) ? hierarchy_.clusters().Children(node - kFirstCluster).size() : 4;
  };
  if (link.receiver == link.shooter) {
    return children(link.receiver) * children(link.receiver);
  }
  return children(decision == Decision::kDivideReceiver ? link.receiver : link.shooter);
}

bool Linker::MeasureAll(std::span<Link> links, const std::function<bool()>& stop) {
  for (std::size_t begin = 0; begin < links.size(); begin += kChunk) {
    if (begin > 0 && stop && stop()) {
      return false;
    }
    const std::span<Link> chunk = links.subspan(begin, std::min(kChunk, links.size() - begin));
    ParallelFor(chunk.size(), [&](std::size_t k) { Measure(chunk[k]); });
    measured_ += chunk.size();
  }
  return true;
}

std::size_t Linker::Refine(const Oracle& oracle, const std::function<bool()>& stop) {
  std::vector<Link> kept;
  std::vector<Link> open(links_.all().begin(), links_.all().end());
  shares_.assign(links_.shares().begin(), links_.shares().end());
  std::size_t replaced = 0;
  while (!open.empty()) {
    if (stop && stop()) {
      kept.insert(kept.end(), open.begin(), open.end());
      break;
    }
    std::vector<Decision> decisions(open.size());
    ParallelFor(open.size(), [&](std::size_t k) { decisions[k] = oracle.Judge(hierarchy_, open[k]); });
    const std::size_t kept_before = kept.size();
    // One thread divides, in the links' order, so that elements are numbered the same on any number of
    // threads.
    std::vector<Link> next;
    std::size_t next_count = 0;
    std::size_t kept_count = kept.size();
    for (std::size_t k = 0; k < open.size(); ++k) {
      decisions[k] == Decision::kKeep ? ++kept_count : next_count += CountOfReplaced(open[k], decisions[k]);
    }
    const auto tell = [&] {
      // The kept ones are moved to where there is room for more.
      Tell(BytesOf(kept) + (BytesOf(open) + BytesOf(decisions)) + (kept_count + next_count) * sizeof(Link));
    };
    tell();
    next.reserve(next_count);
    kept.reserve(kept_count);
    for (std::size_t k = 0; k < open.size(); ++k) {
      if (k % kChunk == 0) {
        tell();
      }
      const Link& link = open[k];
      if (decisions[k] == Decision::kKeep) {
        kept.push_back(link);
        continue;
      }
      ++replaced;
      Replace(link, decisions[k], next);
    }
    basis_.Extend(hierarchy_);
    if (!MeasureAll(next, stop) || !CarryAll(std::span(kept).subspan(kept_before), stop)) {
      kept.resize(kept_before);
      kept.insert(kept.end(), open.begin(), open.end());
      break;
    }
    open.clear();
    AppendLive(open, next);
  }
  Assign(kept);
  return replaced;
}

}  // namespace radbake
