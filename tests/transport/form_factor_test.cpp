#include "solver/transport/form_factor.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "solver/refine/hierarchical.h"
#include "solver/transport/seen_polygon.h"

namespace radbake {
namespace {

constexpr double kPi = std::numbers::pi;

Polygon Quad(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
  Polygon polygon;
  polygon.count = 4;
  polygon[0] = a;
  polygon[1] = b;
  polygon[2] = c;
  polygon[3] = d;
  polygon.normal = (b - a).cross(d - a).normalized();
  return polygon;
}

Polygon Triangular(const Vec3& a, const Vec3& b, const Vec3& c) {
  Polygon polygon;
  polygon.count = 3;
  polygon[0] = a;
  polygon[1] = b;
  polygon[2] = c;
  polygon.normal = (b - a).cross(c - a).normalized();
  return polygon;
}

const Polygon kFloor = Quad({0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0});

Polygon CeilingAt(double height) {
  return Quad({0, 0, height}, {0, 1, height}, {1, 1, height}, {1, 0, height});
}

/// Howell's catalogue C-11: identical, parallel, directly opposed rectangles a × b at distance c; X = a/c, Y
/// = b/c.
double ParallelRectangles(double x, double y) {
  const double x2 = 1 + x * x;
  const double y2 = 1 + y * y;
  return 2 / (kPi * x * y) *
         (std::log(std::sqrt(x2 * y2 / (x2 + y * y))) + x * std::sqrt(y2) * std::atan(x / std::sqrt(y2)) +
          y * std::sqrt(x2) * std::atan(y / std::sqrt(x2)) - x * std::atan(x) - y * std::atan(y));
}

/// Howell's catalogue C-14: two rectangles with a common edge at a right angle; H = h/l, W = w/l.
double PerpendicularRectangles(double h, double w) {
  const double h2 = h * h;
  const double w2 = w * w;
  const double s = h2 + w2;
  return 1 / (kPi * w) *
         (w * std::atan(1 / w) + h * std::atan(1 / h) - std::sqrt(s) * std::atan(1 / std::sqrt(s)) +
          0.25 * std::log((1 + w2) * (1 + h2) / (1 + s) * std::pow(w2 * (1 + s) / ((1 + w2) * s), w2) *
                          std::pow(h2 * (1 + s) / ((1 + h2) * s), h2)));
}

TEST(ExchangeArea, OfParallelUnitSquaresIsTheCataloguesAtEveryDistance) {
  for (const double distance : {0.01, 0.1, 1.0, 3.0, 10.0, 30.0}) {
    const double expected = ParallelRectangles(1 / distance, 1 / distance);
    EXPECT_NEAR(ExchangeArea(kFloor, CeilingAt(distance)) / expected, 1, 1e-6) << "distance " << distance;
  }
}

TEST(ExchangeArea, OfTouchingPerpendicularRectanglesIsTheCatalogues) {
  for (const double height : {0.05, 0.5, 1.0, 4.0}) {
    const Polygon wall = Quad({0, 0, 0}, {0, 1, 0}, {0, 1, height}, {0, 0, height});
    EXPECT_NEAR(ExchangeArea(kFloor, wall) / PerpendicularRectangles(height, 1), 1, 1e-6)
        << "height " << height;
  }
}

TEST(ExchangeArea, OfSquaresThatTouchButForRoundingIsThatOfThoseThatDo) {
  const double touching = PerpendicularRectangles(1, 1);
  for (const double off : {1e-8, 1e-7, 1e-6, 1e-5}) {
    // The wall's edge lies askew beside the floor's, or crosses over it.
    const Polygon beside = Quad({off, 0, off}, {off, 1, 0.1 * off}, {0, 1, 1}, {0, 0, 1});
    const Polygon across = Quad({off, 0, 0.1 * off}, {-off, 1, 0.1 * off}, {-off, 1, 1}, {off, 0, 1});
    EXPECT_NEAR(ExchangeArea(kFloor, beside), touching, 3 * off);
    EXPECT_NEAR(ExchangeArea(kFloor, across), touching, 3 * off);
  }
}

TEST(ExchangeArea, OfAWallWithAnEdgeOfHardlyAnyLengthAtTheFloorsCornerIsThatOfOneWithoutIt) {
  const Vec3 at(-0.4971387, 0.4907009, -0.4999997);  // where sums are rounded
  const Polygon floor = Quad(at, at + Vec3(1, 0, 0), at + Vec3(1, 1, 0), at + Vec3(0, 1, 0));
  const Polygon with = Quad(at, floor[3], floor[3] + Vec3(0, 3e-10, 6e-10), at + Vec3(0, 0, 1));
  const Polygon without = Triangular(at, floor[3], at + Vec3(0, 0, 1));
  EXPECT_NEAR(ExchangeArea(floor, with), ExchangeArea(floor, without), 1e-8);
}

TEST(ExchangeArea, OfElementsOfTouchingSquaresAddsUpToTheWhole) {
  const Polygon wall = Quad({0, 0, 0}, {0, 1, 0}, {0, 1, 1}, {0, 0, 1});
  static constexpr int kCells = 4;
  double sum = 0;
  const auto cell = [](const Polygon& whole, int row, int column) {
    const auto at = [&](int u, int v) -> Vec3 {
      return whole[0] + (whole[1] - whole[0]) * u / kCells + (whole[3] - whole[0]) * v / kCells;
    };
    return Quad(at(column, row), at(column + 1, row), at(column + 1, row + 1), at(column, row + 1));
  };
  for (int i = 0; i < kCells * kCells; ++i) {
    for (int j = 0; j < kCells * kCells; ++j) {
      sum += ExchangeArea(cell(kFloor, i / kCells, i % kCells), cell(wall, j / kCells, j % kCells));
    }
  }
  EXPECT_NEAR(sum / PerpendicularRectangles(1, 1), 1, 1e-6);
}

TEST(ExchangeArea, IsReciprocalForRandomTriangles) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> unit(-1, 1);
  const auto point = [&] { return Vec3(unit(random), unit(random), unit(random)); };
  int facing = 0;
  for (int k = 0; k < 300; ++k) {
    const Polygon a = Triangular(point(), point(), point());
    const Polygon b = Triangular(point(), point(), point());
    const double ab = ExchangeArea(a, b);
    if (ab > 1e-6) {
      ++facing;
      EXPECT_NEAR(ExchangeArea(b, a) / ab, 1, 1e-6);
    }
  }
  EXPECT_GT(facing, 100);
}

/// Triangles and quadrilaterals of aspects up to 10 around the origin, `size` wide.
Polygon RandomPolygon(std::mt19937& random, double size) {
  std::uniform_real_distribution<double> unit(-1, 1);
  const auto vector = [&] { return Vec3(unit(random), unit(random), unit(random)); };
  const Vec3 along = size * vector().normalized();
  const Vec3 side = along.cross(vector()).normalized();
  const Vec3 across = std::pow(10, -std::abs(unit(random))) * size * side + 0.5 * unit(random) * along;
  const Vec3 corner = -0.5 * (along + across);
  return random() % 2 == 0 ? Triangular(corner, corner + along, corner + across)
                           : Quad(corner, corner + along, corner + 0.9 * along + across, corner + across);
}

struct Errors {
  double square = 0;
  int count = 0;
  void Add(double estimate, double exact) {
    square += std::pow(estimate / exact - 1, 2);
    ++count;
  }
  double Rms() const { return std::sqrt(square / count); }
};

TEST(FormFactors, ByPointsErrByLessThanTheirToleranceOnTheAverage) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> unit(0, 1);
  for (const double tolerance : {1e-5, 1e-4, 1e-3}) {
    Errors between;
    Errors from_point;
    for (int k = 0; k < 8000; ++k) {
      const Polygon a = RandomPolygon(random, 1);
      Polygon b = RandomPolygon(random, std::pow(10, unit(random) - 0.5));
      const Vec3 away = std::pow(10, unit(random)) * RandomPolygon(random, 1).normal;
      for (int c = 0; c < b.count; ++c) {
        b[c] += away;
      }
      const double exact = ExchangeArea(a, b);
      const double estimate = ExchangeArea(a, b, tolerance);
      EXPECT_NEAR(ExchangeArea(b, a, tolerance), estimate, 1e-6 * estimate);
      if (exact > 1e-7 && estimate != exact) {
        between.Add(estimate, exact);
      }
      const double seen = PointToPolygon(Vec3::Zero(), a.normal, b);
      const double by_points = PointToPolygon(Vec3::Zero(), a.normal, b, tolerance);
      if (seen > 1e-7 && by_points != seen) {
        from_point.Add(by_points, seen);
      }
    }
    EXPECT_GT(between.count, 100);
    EXPECT_GT(from_point.count, 200);
    EXPECT_LT(between.Rms(), tolerance);
    EXPECT_LT(from_point.Rms(), tolerance);
  }
}

TEST(ExchangeArea, OfPolygonsThatCrossEachOthersPlaneMatchesPointwiseIntegration) {
  const Polygon tilted = Quad({0.2, 0.3, -0.5}, {0.2, 0.9, -0.5}, {0.7, 0.9, 0.5}, {0.7, 0.3, 0.5});
  constexpr int kGrid = 400;
  double sum = 0;
  for (int u = 0; u < kGrid; ++u) {
    for (int v = 0; v < kGrid; ++v) {
      sum += PointToPolygon(Vec3((u + 0.5) / kGrid, (v + 0.5) / kGrid, 0), Vec3::UnitZ(), tilted);
    }
  }
  EXPECT_NEAR(ExchangeArea(kFloor, tilted), sum / (kGrid * kGrid), 1e-5);
}

TEST(ExchangeArea, IsZeroForCoplanarAndForAvertedPolygons) {
  const Polygon beside = Quad({1, 0, 0}, {2, 0, 0}, {2, 1, 0}, {1, 1, 0});
  EXPECT_EQ(ExchangeArea(kFloor, beside), 0);
  const Polygon above_facing_up = Quad({0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1});
  EXPECT_EQ(ExchangeArea(kFloor, above_facing_up), 0);
}

TEST(PointToPolygon, BelowTheCornerOfARectangleIsTheCatalogues) {
  // Howell B-4: a point below a corner of a rectangle a × b at distance c, parallel planes.
  const double x = 0.8;
  const double y = 1.7;
  const double expected = 1 / (2 * kPi) *
                          (x / std::sqrt(1 + x * x) * std::atan(y / std::sqrt(1 + x * x)) +
                           y / std::sqrt(1 + y * y) * std::atan(x / std::sqrt(1 + y * y)));
  const Polygon above = Quad({0, 0, 1}, {0, y, 1}, {x, y, 1}, {x, 0, 1});
  EXPECT_NEAR(PointToPolygon(Vec3(0, 0, 0), Vec3::UnitZ(), above), expected, 1e-12);
}

TEST(PointToPolygon, OfTheWallsOfAClosedRoomSumsToOneAnywhere) {
  const std::array<Polygon, 5> walls = {CeilingAt(1), Quad({0, 0, 0}, {0, 1, 0}, {0, 1, 1}, {0, 0, 1}),
                                        Quad({1, 0, 0}, {1, 0, 1}, {1, 1, 1}, {1, 1, 0}),
                                        Quad({0, 0, 0}, {0, 0, 1}, {1, 0, 1}, {1, 0, 0}),
                                        Quad({0, 1, 0}, {1, 1, 0}, {1, 1, 1}, {0, 1, 1})};
  for (const double at : {1e-9, 1e-4, 0.3, 0.5, 1 - 1e-7}) {
    double sum = 0;
    for (const Polygon& wall : walls) {
      sum += PointToPolygon(Vec3(at, 0.5 * at, 0), Vec3::UnitZ(), wall);
    }
    EXPECT_NEAR(sum, 1, 1e-6) << "at " << at;
  }
}

TEST(EstimateFormFactor, BoundsTheMeanFormFactorOfRandomFacingSquaresFromAboveWithinAFactor) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(0, 1);
  for (int k = 0; k < 200; ++k) {
    const double size = 0.05 + unit(random);
    const Vec3 at(2 * unit(random) - 1, 2 * unit(random) - 1, 0.2 + unit(random));
    const Polygon other = Quad(at, at + Vec3(0, size, 0), at + Vec3(size, size, 0), at + Vec3(size, 0, 0));
    const double estimate = EstimateFormFactor(kFloor, other, size * size);
    EXPECT_LE(ExchangeArea(kFloor, other), 1.5 * estimate);
  }
}

}  // namespace
}  // namespace radbake
