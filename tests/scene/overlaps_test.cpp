#include "solver/scene/overlaps.h"

#include <gtest/gtest.h>

namespace radbake {
namespace {

constexpr double kTolerance = 1e-7;

/// A square of the plane z, its lower left corner at (x, y).
Polygon Square(double x, double y, double z, double side) {
  Polygon square;
  square.count = 4;
  square.corner = {Vec3(x, y, z), Vec3(x + side, y, z), Vec3(x + side, y + side, z), Vec3(x, y + side, z)};
  square.normal = Vec3::UnitZ();
  return square;
}

Polygon Turned(const Polygon& polygon) {
  Polygon turned = polygon;
  for (int k = 0; k < polygon.count; ++k) {
    turned[k] = polygon[polygon.count - 1 - k];
  }
  turned.normal = -polygon.normal;
  return turned;
}

/// Of faces that do not shine.
Overlaps Alike(const std::vector<Polygon>& faces) {
  return {faces, std::vector<double>(faces.size()), kTolerance};
}

TEST(Overlaps, TheFirstOfTwoIsThere) {
  const std::vector<Polygon> faces = {Square(0, 0, 0, 1), Square(0.5, 0.5, 5e-8, 1)};
  const Overlaps overlaps = Alike(faces);
  EXPECT_FALSE(overlaps.AnyOver(0));
  EXPECT_TRUE(overlaps.AnyOver(1));
  EXPECT_EQ(overlaps.At(1, Vec3(0.75, 0.75, 0)), 0U);
  EXPECT_EQ(overlaps.At(1, Vec3(1.25, 0.75, 0)), 1U);
  EXPECT_EQ(overlaps.At(0, Vec3(0.75, 0.75, 0)), 0U);
}

TEST(Overlaps, TheFirstOfMoreIsThere) {
  const std::vector<Polygon> faces = {Square(0.5, 0, 0, 0.5), Square(0, 0, 0, 1), Square(0, 0, 0, 2)};
  const Overlaps overlaps = Alike(faces);
  EXPECT_EQ(overlaps.At(2, Vec3(0.75, 0.25, 0)), 0U);
  EXPECT_EQ(overlaps.At(2, Vec3(0.25, 0.25, 0)), 1U);
  EXPECT_EQ(overlaps.At(2, Vec3(1.5, 1.5, 0)), 2U);
}

TEST(Overlaps, TheBrightestIsThere) {
  const std::vector<Polygon> faces = {Square(0, 0, 0, 3), Square(1, 0, 0, 1), Square(1, 0, 0, 2)};
  const std::vector<double> emission = {0, 1, 2};
  const Overlaps overlaps(faces, emission, kTolerance);
  EXPECT_FALSE(overlaps.AnyOver(2));
  EXPECT_EQ(overlaps.At(0, Vec3(0.5, 0.5, 0)), 0U);
  EXPECT_EQ(overlaps.At(0, Vec3(1.5, 0.5, 0)), 2U);
  EXPECT_EQ(overlaps.At(1, Vec3(1.5, 0.5, 0)), 2U);
}

TEST(Overlaps, NeighboursAndParallelsAndBacksDoNot) {
  const Polygon square = Square(0, 0, 0, 1);
  for (const Polygon& other : {Square(1, 0, 0, 1), Square(1 - 1e-9, 0, 0, 1), Square(0, 0, 1e-6, 1),
                               Turned(Square(0.5, 0.5, 0, 1)), Polygon()}) {
    EXPECT_TRUE(Alike({square, other}).empty());
  }
}

TEST(Overlaps, AreFoundAmongMany) {
  // A tiled floor, and on it some tiles that lie across four others.
  std::vector<Polygon> faces;
  constexpr int kSide = 60;
  for (int i = 0; i < kSide * kSide; ++i) {
    faces.push_back(Square(i % kSide, i / kSide, 0, 1));
  }
  for (int i = 0; i + 1 < kSide; ++i) {
    faces.push_back(Square(i + 0.5, i + 0.5, 0, 1));
  }
  const Overlaps overlaps = Alike(faces);
  for (Index i = 0; i < kSide * kSide; ++i) {
    EXPECT_FALSE(overlaps.AnyOver(i)) << i;
  }
  for (Index i = 0; i + 1 < kSide; ++i) {
    const Index above = kSide * kSide + i;
    EXPECT_EQ(overlaps.At(above, Vec3(i + 0.75, i + 0.75, 0)), i * kSide + i);
    EXPECT_EQ(overlaps.At(above, Vec3(i + 1.25, i + 0.75, 0)), i * kSide + i + 1);
    EXPECT_EQ(overlaps.At(above, Vec3(i + 0.75, i + 1.25, 0)), (i + 1) * kSide + i);
    EXPECT_EQ(overlaps.At(above, Vec3(i + 1.25, i + 1.25, 0)), (i + 1) * kSide + i + 1);
  }
}

}  // namespace
}  // namespace radbake
