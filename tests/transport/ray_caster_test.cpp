#include "solver/transport/ray_caster.h"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <random>

namespace radbake {
namespace {

// Random numbers that are the same everywhere.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  double Uniform(double low, double high) {
    return low + (high - low) * static_cast<double>(engine_() >> 11U) * 0x1p-53;
  }
  Vec3 InCube(double half) { return {Uniform(-half, half), Uniform(-half, half), Uniform(-half, half)}; }
  Vec3 Direction() {
    const double z = Uniform(-1, 1);
    const double angle = Uniform(0, 2 * M_PI);
    const double radius = std::sqrt(1 - z * z);
    return {radius * std::cos(angle), radius * std::sin(angle), z};
  }

 private:
  std::mt19937_64 engine_;
};

struct Crossing {
  double t;       // of the plane, in lengths of the direction
  double margin;  // of the triangle's nearest edge: positive inside
  bool front;
};

std::optional<Crossing> Cross(const Corners& corners, const Vec3& origin, const Vec3& direction) {
  const Vec3 normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalized();
  const double slope = normal.dot(direction);
  if (slope == 0) {
    return std::nullopt;
  }
  const double t = normal.dot(corners[0] - origin) / slope;
  const Vec3 point = origin + t * direction;
  double margin = INFINITY;
  for (std::size_t i = 0; i < 3; ++i) {
    const Vec3 edge = (corners[(i + 1) % 3] - corners[i]).normalized();
    margin = std::min(margin, normal.cross(edge).dot(point - corners[i]));
  }
  return Crossing{t, margin, slope < 0};
}

std::vector<Corners> Soup(std::size_t count, double size, Random& random) {
  std::vector<Corners> soup;
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3 centre = random.InCube(0.5);
    soup.push_back(
        {centre + random.InCube(size), centre + random.InCube(size), centre + random.InCube(size)});
  }
  return soup;
}

void AddQuad(std::vector<Corners>& triangles, const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
  triangles.push_back({a, b, c});
  triangles.push_back({a, c, d});
}

// A closed box around the origin, turned so that nothing is aligned with the axes; fronts face inwards.
struct Box {
  Eigen::Matrix3d turn =
      (Eigen::AngleAxisd(0.7, Vec3::UnitX()) * Eigen::AngleAxisd(0.4, Vec3::UnitZ())).toRotationMatrix();
  std::vector<Vec3> corners;
  std::vector<Corners> triangles;

  explicit Box(double half) {
    for (unsigned i = 0; i < 8; ++i) {
      corners.emplace_back(turn * Vec3((i & 1U) != 0 ? half : -half, (i & 2U) != 0 ? half : -half,
                                       (i & 4U) != 0 ? half : -half));
    }
    AddQuad(triangles, corners[0], corners[1], corners[3], corners[2]);
    AddQuad(triangles, corners[4], corners[6], corners[7], corners[5]);
    AddQuad(triangles, corners[0], corners[4], corners[5], corners[1]);
    AddQuad(triangles, corners[2], corners[3], corners[7], corners[6]);
    AddQuad(triangles, corners[0], corners[2], corners[6], corners[4]);
    AddQuad(triangles, corners[1], corners[5], corners[7], corners[3]);
  }
};

TEST(RayCaster, FindsTheTriangleThatExactArithmeticFinds) {
  Random random(1);
  const std::vector<Corners> soup = Soup(300, 0.2, random);
  const RayCaster caster(soup);
  constexpr double kEdge = 1e-6;  // single precision decides within this distance of an edge
  std::size_t hits = 0;
  for (int ray = 0; ray < 3000; ++ray) {
    const Vec3 origin = random.InCube(0.7);
    const Vec3 direction = random.Direction() * random.Uniform(0.1, 5);
    double surely = INFINITY;
    double perhaps = INFINITY;
    for (const Corners& corners : soup) {
      if (const auto crossing = Cross(corners, origin, direction); crossing && crossing->t > 0) {
        if (crossing->margin > kEdge) {
          surely = std::min(surely, crossing->t);
        }
        if (crossing->margin > -kEdge) {
          perhaps = std::min(perhaps, crossing->t);
        }
      }
    }
    const auto hit = caster.Closest(origin, direction);
    if (!hit) {
      EXPECT_EQ(surely, INFINITY);
      continue;
    }
    ++hits;
    EXPECT_LE(hit->distance, surely + 1e-5);
    EXPECT_GE(hit->distance, perhaps - 1e-5);
    const auto crossing = Cross(soup[hit->triangle], origin, direction);
    ASSERT_TRUE(crossing);
    EXPECT_NEAR(hit->distance, crossing->t, 1e-12 + 1e-10 * crossing->t);
    EXPECT_EQ(hit->front, crossing->front);
    EXPECT_GT(crossing->margin, -kEdge);
  }
  EXPECT_GT(hits, 1000);
}

TEST(RayCaster, SeesBetweenTwoPointsAsExactArithmeticDoes) {
  Random random(2);
  const std::vector<Corners> soup = Soup(100, 0.2, random);
  const RayCaster caster(soup);
  constexpr double kEdge = 1e-6;
  std::size_t occluded = 0;
  std::size_t visible = 0;
  for (int ray = 0; ray < 3000; ++ray) {
    const Vec3 a = random.InCube(0.6);
    const Vec3 b = random.InCube(0.6);
    bool surely = false;
    bool perhaps = false;
    for (const Corners& corners : soup) {
      if (const auto crossing = Cross(corners, a, b - a); crossing && crossing->t > 0 && crossing->t < 1) {
        surely |= crossing->margin > kEdge && crossing->t > kEdge && crossing->t < 1 - kEdge;
        perhaps |= crossing->margin > -kEdge;
      }
    }
    const bool found = caster.Occluded(a, b);
    EXPECT_TRUE(found || !surely);
    EXPECT_TRUE(!found || perhaps);
    ++(found ? occluded : visible);
  }
  EXPECT_GT(occluded, 1000);
  EXPECT_GT(visible, 1000);
}

TEST(RayCaster, LetsNothingOutOfAClosedBox) {
  const Box box(0.5);
  const RayCaster caster(box.triangles);
  Random random(3);
  for (int ray = 0; ray < 100000; ++ray) {
    const Vec3 origin = box.turn * random.InCube(0.499);
    ASSERT_TRUE(caster.Closest(origin, random.Direction()));
    ASSERT_TRUE(caster.Occluded(origin, 2 * random.Direction()));
  }
}

TEST(RayCaster, LetsNothingOutThroughEdgesAndCorners) {
  const Box box(0.5);
  const RayCaster caster(box.triangles);
  Random random(4);
  for (int ray = 0; ray < 100000; ++ray) {
    const Vec3 origin = box.turn * random.InCube(0.49);
    const Corners& triangle = box.triangles[static_cast<std::size_t>(ray) % box.triangles.size()];
    const auto first = static_cast<std::size_t>(ray / 12 % 3);
    const double along = ray % 5 == 0 ? 0 : random.Uniform(0, 1);
    const Vec3 target = (1 - along) * triangle[first] + along * triangle[(first + 1) % 3];
    const auto hit = caster.Closest(origin, target - origin);
    ASSERT_TRUE(hit);
    EXPECT_NEAR(hit->distance, 1, 1e-5);
    EXPECT_TRUE(hit->front);
    ASSERT_TRUE(caster.Occluded(origin, origin + 1.001 * (target - origin)));
    ASSERT_FALSE(caster.Occluded(origin, origin + 0.999 * (target - origin)));
  }
}

TEST(RayCaster, DoesNotHitTheTrianglesThatItsEndsLieOn) {
  const Box box(0.5);
  const RayCaster caster(box.triangles);
  Random random(5);
  const auto on = [&](const Corners& corners) -> Vec3 {
    const double u = random.Uniform(0, 1);
    const double v = random.Uniform(0, 1 - u);
    return (1 - u - v) * corners[0] + u * corners[1] + v * corners[2];
  };
  for (int ray = 0; ray < 100000; ++ray) {
    const std::size_t i = static_cast<std::size_t>(ray) % 12;
    const std::size_t j = static_cast<std::size_t>(ray / 12) % 12;
    const Vec3 a = on(box.triangles[i]);
    const Vec3 b = on(box.triangles[j]);
    ASSERT_FALSE(caster.Occluded(a, b));
    if (i / 2 != j / 2) {
      const auto hit = caster.Closest(a, b - a);
      ASSERT_TRUE(hit);
      EXPECT_NEAR(hit->distance, 1, 1e-4);
    }
  }
}

TEST(RayCaster, DoesNotHitWhatLiesInTheSamePlaneAsAnEnd) {
  // A tilted plane in two sheets: the second lies on the first, rounded to single precision.
  const Box box(0.4);
  std::vector<Corners> sheets(box.triangles.begin(), box.triangles.begin() + 2);
  for (std::size_t i = 0; i < 2; ++i) {
    Corners rounded = sheets[i];
    for (Vec3& corner : rounded) {
      corner = (0.7 * corner).cast<float>().cast<double>() + 0.3 * (box.corners[0] + box.corners[3]) / 2;
    }
    sheets.push_back(rounded);
  }
  const RayCaster caster(sheets);
  const Vec3 inwards = box.turn * Vec3(0, 0, 1);
  Random random(6);
  for (int ray = 0; ray < 10000; ++ray) {
    const Vec3 start = box.turn * Vec3(random.Uniform(-0.4, 0.4), random.Uniform(-0.4, 0.4), -0.4);
    Vec3 direction = random.Direction();
    direction *= direction.dot(inwards) < 0 ? -1 : 1;
    ASSERT_FALSE(caster.Occluded(start, start + 0.3 * direction));
    ASSERT_FALSE(caster.Closest(start, direction));
    ASSERT_FALSE(caster.Closest(start, -direction));
  }
}

TEST(RayCaster, TellsALampFromTheCeilingOneMillionthAboveIt) {
  const double height = 0.5;
  std::vector<Corners> triangles;
  AddQuad(triangles, {-0.5, -0.5, height}, {-0.5, 0.5, height}, {0.5, 0.5, height}, {0.5, -0.5, height});
  const double lamp = height - 1e-6;
  AddQuad(triangles, {-0.1, -0.1, lamp}, {-0.1, 0.1, lamp}, {0.1, 0.1, lamp}, {0.1, -0.1, lamp});
  const RayCaster caster(triangles);
  Random random(7);
  for (int ray = 0; ray < 10000; ++ray) {
    const Vec3 below(random.Uniform(-0.5, 0.5), random.Uniform(-0.5, 0.5), -0.5);
    const Vec3 on_lamp(random.Uniform(-0.099, 0.099), random.Uniform(-0.099, 0.099), lamp);
    const Vec3 behind_lamp(on_lamp.x(), on_lamp.y(), height);
    ASSERT_FALSE(caster.Occluded(below, on_lamp));
    ASSERT_TRUE(caster.Occluded(below, behind_lamp));
    ASSERT_TRUE(caster.Occluded(behind_lamp, below));
    const auto hit = caster.Closest(below, on_lamp - below);
    ASSERT_TRUE(hit);
    EXPECT_GE(hit->triangle, 2U);
  }
}

TEST(RayCaster, NeverHitsTrianglesWithoutArea) {
  const Vec3 a(-0.5, 0, 0);
  const Vec3 b(0.5, 0, 0);
  const std::vector<Corners> degenerate = {{a, b, 0.5 * (a + b)}, {a, a, b}, {a, a, a}};
  const RayCaster caster(degenerate);
  EXPECT_FALSE(caster.Occluded({0.1, 0, 1}, {0.1, 0, -1}));
  EXPECT_FALSE(caster.Closest({0.1, 0, 1}, {0, 0, -1}));
}

TEST(RayCaster, SeesThroughAnEmptyScene) {
  const RayCaster caster({});
  EXPECT_FALSE(caster.Occluded({0, 0, 0}, {1, 0, 0}));
  EXPECT_FALSE(caster.Closest({0, 0, 0}, {1, 0, 0}));
}

TEST(RayCaster, CountsTheTimeOfItsRays) {
  const Box box(0.5);
  const RayCaster caster(box.triangles);
  EXPECT_EQ(caster.Seconds(), 0);
  const auto cast = [&] {
    Random random(5);
    for (int k = 0; k < 5000; ++k) {
      caster.Closest(random.InCube(0.4), random.Direction());
      caster.Occluded(random.InCube(0.4), random.InCube(0.4));
    }
    return caster.Seconds();
  };
  const double once = cast();
  EXPECT_GT(once, 0);
  EXPECT_GT(cast(), once);
}

TEST(RayCaster, SeesAPointFromItself) {
  const Box box(0.5);
  const RayCaster caster(box.triangles);
  EXPECT_FALSE(caster.Occluded({0.1, 0, 0}, {0.1, 0, 0}));
}

}  // namespace
}  // namespace radbake
