/// Transport to and from nodes that are no polygons, clusters and lights without area, by rays between points
/// on both.
#pragma once

#include <cstdint>
#include <vector>

#include "solver/hierarchy/hierarchy.h"
#include "solver/hierarchy/light.h"
#include "solver/transport/visibility.h"

namespace radbake {

/// A point of a surface and the normal of its lit side.
struct SurfacePoint {
  Vec3 x;
  Vec3 normal;
  Index patch = kNone;
};

/// A point of an element's or a cluster's surfaces, uniform by area for a point of the unit cube.
SurfacePoint PointOfNode(const Hierarchy& hierarchy, Index node, std::array<double, 3> u);

/// One link as rays see it.
struct NodeTransport {
  /// Mean of the kernel over the receiver, unoccluded; of a light, per unit intensity. Times `visibility` its
  /// expectation is what is transported, whatever is in between and however near the two are; alone it is an
  /// estimate that is too low where they touch or hold one another.
  double form_factor = 0;
  double variation =
      0;  ///< bound of how much that varies over the receiver, beyond what orientation explains
  double visibility = 0;
  std::vector<PatchShare> sources;    ///< of a shooting cluster, what rays met
  std::vector<PatchShare> receivers;  ///< of a receiving cluster of few patches, what their light falls on
};

/// Between a receiver (an element or a cluster) and a shooter (any node), at least one of them no element.
/// A cluster and itself: what its patches exchange. form_factor and variation are 0 if it is proved that the
/// two do not face one another; where rays found nothing and nothing is proved, the variation says what they
/// may have missed. Other rays for another `key`: what oracles judge a link by should not be what it carries,
/// or those would stay that carry too little.
NodeTransport BetweenNodes(const Hierarchy& hierarchy, const Visibility& visibility, Index receiver,
                           Index shooter, std::uint64_t key, int rays);

/// What rays from the patches meet inside the clusters above them. Empty without clusters.
Openness LookAround(const Hierarchy& hierarchy, const Visibility& visibility);

/// Is it proved that nothing is between an element and a light without area?
bool ClearToLight(const Visibility& visibility, const Polygon& receiver, const PunctualLight& light);

/// A share of form factors that is nothing beside the oracle's errors, for PointToPolygon and ExchangeArea:
/// the smaller, the more is reflected, since a closed room adds errors up over all reflections.
double FormFactorTolerance(const Patches& patches);

/// Irradiance at `x` with unit normal `n` per unit of what the node shoots, unoccluded: exact from an
/// element, or with this tolerance of PointToPolygon's, and from a light; from a cluster as if all of it were
/// in its middle.
double UnoccludedAt(const Hierarchy& hierarchy, const Vec3& x, const Vec3& n, Index shooter,
                    double tolerance = 0);

/// Irradiance at `x` with unit normal `n` from a cluster, by `rays` points on its patches and what each of
/// those shoots; or from a light, by one ray.
Rgb FromNodeAt(const Hierarchy& hierarchy, const Light& light, const Visibility& visibility, const Vec3& x,
               const Vec3& n, Index shooter, QuasiRandom<3>& random, int rays);

}  // namespace radbake
