#include "solver/transport/shaft.h"

#include <gtest/gtest.h>

#include "solver/hierarchy/hierarchy.h"
#include "solver/transport/form_factor.h"
#include "solver/transport/sampling.h"
#include "solver/transport/visibility.h"
#include "tests/test_scenes.h"

namespace radbake {
namespace {

TEST(Occluders, ProveEveryPairOfAConvexRoomClear) {
  const Patches patches = CutIntoPatches(testing::FurnaceSphere(0.5, 1));
  EXPECT_TRUE(Occluders(patches).empty());
}

/// Without a hundredth along its edges: a ray from a place at the very edge of a body may pass the edge
/// closer than rays are exact (see RayCaster).
Polygon Inner(Polygon polygon) {
  const Vec3 centre = polygon.Centroid();
  for (int k = 0; k < polygon.count; ++k) {
    polygon[k] += 0.01 * (centre - polygon[k]);
  }
  return polygon;
}

TEST(Occluders, NeverProveAPairClearThatARayFindsBlocked) {
  const Patches patches = CutIntoPatches(testing::ShadowRoom());
  Hierarchy hierarchy(patches);
  for (Index e = 0; e < 85 * patches.patches.size(); ++e) {
    hierarchy.Divide(e);
  }
  const Visibility visibility(patches);
  std::size_t clear = 0;
  std::size_t blocked = 0;
  for (Index k = 0; k < 60'000; ++k) {
    const auto a = static_cast<Index>(Hash(2 * k) % hierarchy.size());
    const auto b = static_cast<Index>(Hash(2 * k + 1) % hierarchy.size());
    const Polygon p = hierarchy.Shape(a);
    const Polygon q = hierarchy.Shape(b);
    if (ExchangeArea(p, q) == 0) {
      continue;
    }
    const bool open = visibility.BetweenElements(Inner(p), Inner(q), ExchangeArea(p, q), k, 8).judged == 1;
    if (visibility.Clear(p, q)) {
      ++clear;
      EXPECT_TRUE(open) << "elements " << a << " and " << b;
    }
    blocked += open ? 0 : 1;
  }
  EXPECT_GT(clear, 1000U);
  EXPECT_GT(blocked, 1000U);
}

TEST(Occluders, ProveMostOpenPairsOfARoomWithOneSlabClear) {
  const Patches patches = CutIntoPatches(testing::ShadowRoom());
  Hierarchy hierarchy(patches);
  for (Index e = 0; e < 21 * patches.patches.size(); ++e) {
    hierarchy.Divide(e);
  }
  const Visibility visibility(patches);
  std::size_t open = 0;
  std::size_t proved = 0;
  for (Index k = 0; k < 20'000; ++k) {
    const Polygon p = hierarchy.Shape(static_cast<Index>(Hash(3 * k) % hierarchy.size()));
    const Polygon q = hierarchy.Shape(static_cast<Index>(Hash(3 * k + 1) % hierarchy.size()));
    if (ExchangeArea(p, q) > 0 && visibility.BetweenElements(p, q, ExchangeArea(p, q), k, 32).judged == 1) {
      ++open;
      proved += visibility.Clear(p, q) ? 1U : 0U;
    }
  }
  EXPECT_GT(static_cast<double>(proved), 0.8 * static_cast<double>(open));
}

}  // namespace
}  // namespace radbake
