#include "solver/hierarchy/hierarchy.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "solver/transport/sampling.h"
#include "tests/test_scenes.h"

namespace radbake {
namespace {

TEST(Hierarchy, ChildrenCoverTheirParent) {
  for (const Scene& scene : {testing::FurnaceBox(0.5), testing::FurnaceSphere(0.5, 0)}) {
    const Patches patches = CutIntoPatches(scene);
    Hierarchy hierarchy(patches);
    for (Index e = 0; e < 200; ++e) {
      const Index first = hierarchy.Divide(e);
      double sum = 0;
      for (Index child = first; child < first + 4; ++child) {
        EXPECT_EQ(hierarchy[child].parent, e);
        sum += hierarchy[child].area;
        const Polygon shape = hierarchy.Shape(child);
        const Vec3 normal = (shape[1] - shape[0]).cross(shape[2] - shape[0]);
        EXPECT_GT(normal.dot(shape.normal), 0);
      }
      EXPECT_NEAR(sum, hierarchy[e].area, 1e-12);
    }
  }
}

TEST(Hierarchy, FindsTheChildThatHoldsAPoint) {
  Scene scene = testing::FurnaceSphere(0.5, 0);
  const Index grey = testing::AddMaterial(scene, 0.5, 0);
  for (const Vec3& shape : {Vec3(1, 1, 0), Vec3(5, 1, 0), Vec3(1, 5, 0), Vec3(1, 1, 0.4), Vec3(5, 1, 0.3)}) {
    const double slant = shape[2];
    testing::AddQuad(scene, grey, Vec3(3, 0, 0), Vec3(3 + shape[0], 0, slant),
                     Vec3(3 + (1 - slant) * shape[0], (1 + slant) * shape[1], slant * (1 - slant)),
                     Vec3(3, shape[1], 0));
  }
  const Patches patches = CutIntoPatches(scene);
  Hierarchy hierarchy(patches);
  std::array<int, 4> seen{};
  for (Index e = 0; e < 400; ++e) {
    const Index first = hierarchy.Divide(e);
    ++seen[static_cast<std::size_t>(hierarchy[e].division)];
    for (Index child = first; child < first + 4; ++child) {
      QuasiRandom<2> random(child);
      for (int k = 0; k < 16; ++k) {
        const auto u = random.Next();
        const Polygon shape = hierarchy.Shape(child);
        const Vec3 x = PointOn(shape, u[0], u[1]);
        EXPECT_EQ(hierarchy.ChildAt(e, x + 1e-9 * (shape.Centroid() - x)), child) << "of element " << e;
      }
    }
  }
  EXPECT_THAT(seen, ::testing::Each(::testing::Gt(0)));
}

TEST(Hierarchy, CornerKOfAnElementIsCornerKOfItsChildK) {
  const Patches patches = CutIntoPatches(testing::FurnaceBox(0.5));
  Hierarchy hierarchy(patches);
  const Index first = hierarchy.Divide(0);
  for (Index k = 0; k < 4; ++k) {
    EXPECT_EQ(hierarchy[first + k].corner[k], hierarchy[0].corner[k]);
  }
}

TEST(Hierarchy, NeighboursShareTheMidpointOfTheirEdgeAlsoAcrossACrease) {
  const Patches patches = CutIntoPatches(testing::FurnaceBox(0.5));
  Hierarchy hierarchy(patches);
  for (Index e = 0; e < 6; ++e) {
    hierarchy.Divide(e);
  }
  // 8 corners, 12 edges, 6 middles of faces; each crease separates the vertices of two or three faces.
  std::size_t positions = 0;
  for (Index v = 0; v < hierarchy.vertex_count(); ++v) {
    positions = std::max(positions, static_cast<std::size_t>(hierarchy.PositionOf(v)) + 1);
  }
  EXPECT_EQ(positions, 8U + 12U + 6U);
  EXPECT_EQ(hierarchy.vertex_count(), 6U * 9U);
}

TEST(Hierarchy, ASmoothSurfaceSharesItsVertices) {
  const Patches patches = CutIntoPatches(testing::FurnaceSphere(0.5, 1));
  const Hierarchy hierarchy(patches);
  EXPECT_EQ(hierarchy.vertex_count(), 42U);
}

}  // namespace
}  // namespace radbake
