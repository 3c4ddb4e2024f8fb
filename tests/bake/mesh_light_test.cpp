#include "solver/bake/mesh_light.h"

#include <gtest/gtest.h>

#include <limits>

#include "tests/test_scenes.h"

namespace radbake {
namespace {

/// A room whose floor is divided once, and one of its quarters once more.
class MeshLightTest : public ::testing::Test {
 protected:
  MeshLightTest() : patches_(CutIntoPatches(testing::FurnaceBox(0.5))), hierarchy_(patches_) {
    cut_ = {1, 2, 3, 4, 5};
    const Index quarter = hierarchy_.Divide(0);
    const Index sixteenth = hierarchy_.Divide(quarter);
    cut_.insert(cut_.end(), {quarter + 1, quarter + 2, quarter + 3});
    cut_.insert(cut_.end(), {sixteenth, sixteenth + 1, sixteenth + 2, sixteenth + 3});
  }

  static Rgb Linear(const Vec3& x) { return {1 + 0.3 * x[0] - 0.2 * x[1] + 0.7 * x[2], 2, 3 - x[0]}; }
  std::vector<Rgb> AtVertices() const {
    std::vector<Rgb> result;
    for (Index vertex = 0; vertex < hierarchy_.vertex_count(); ++vertex) {
      result.push_back(Linear(hierarchy_.Point(vertex)));
    }
    return result;
  }
  std::vector<Rgb> AtCentres() const {
    std::vector<Rgb> result;
    for (const Index e : cut_) {
      result.push_back(Linear(hierarchy_.Shape(e).Centroid()));
    }
    return result;
  }
  Vec3 OnFloor(double u, double v) const {
    const Polygon shape = hierarchy_.Shape(0);
    return shape[0] + u * (shape[1] - shape[0]) + v * (shape[3] - shape[0]);
  }

  Patches patches_;
  Hierarchy hierarchy_;
  std::vector<Index> cut_;
};

const Rgb kUnseen = Rgb::Constant(std::numeric_limits<double>::quiet_NaN());

TEST_F(MeshLightTest, IsLinearOverWhateverDivision) {
  const MeshLight light(hierarchy_, cut_, AtVertices(), AtCentres());
  for (double u = 0; u <= 1; u += 0.093) {
    for (double v = 0; v <= 1; v += 0.087) {
      const Vec3 y = OnFloor(u, v);
      EXPECT_LT((light.At(0, y) - Linear(y)).abs().maxCoeff(), 1e-12) << u << ", " << v;
    }
  }
}

TEST_F(MeshLightTest, StaysWhatItWasWhereTheHierarchyIsDividedFurther) {
  const MeshLight light(hierarchy_, cut_, AtVertices(), AtCentres());
  const Vec3 y = OnFloor(0.9, 0.8);
  const Rgb before = light.At(0, y);
  hierarchy_.Divide(cut_[6]);
  EXPECT_TRUE((light.At(0, y) == before).all());
}

TEST_F(MeshLightTest, KnowsWhatIsSeenFromWhatIsSeenAlone) {
  std::vector<Rgb> at_vertex = AtVertices();
  for (Index vertex = 0; vertex < at_vertex.size(); ++vertex) {
    if (hierarchy_.Point(vertex)[0] < OnFloor(0.4, 0.4)[0]) {
      at_vertex[vertex] = kUnseen;
    }
  }
  const MeshLight light(hierarchy_, cut_, at_vertex, AtCentres());
  EXPECT_FALSE(light.At(0, OnFloor(0.3, 0.4)).isNaN().any());
  EXPECT_GT(light.At(0, OnFloor(0.3, 0.4)).minCoeff(), 0.5);
  const MeshLight dark(hierarchy_, cut_, std::vector<Rgb>(at_vertex.size(), kUnseen),
                       std::vector<Rgb>(cut_.size(), kUnseen));
  EXPECT_EQ(dark.At(0, OnFloor(0.3, 0.4)).maxCoeff(), 0);
}

}  // namespace
}  // namespace radbake
