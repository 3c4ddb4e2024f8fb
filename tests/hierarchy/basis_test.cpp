#include "solver/hierarchy/basis.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "solver/transport/sampling.h"
#include "tests/test_scenes.h"

namespace radbake {
namespace {

constexpr std::array kHigher = {BasisOrder::kLinear, BasisOrder::kQuadratic};

struct Shape {
  const char* name;
  std::vector<Vec3> corners;
};

/// Of every division, turned out of the axes.
std::vector<Shape> Shapes() {
  std::vector<Shape> shapes = {
      {"triangle", {{0, 0, 0}, {2, 0, 0}, {0.5, 1.5, 0}}},
      {"sliver", {{0, 0, 0}, {1, 0, 0}, {0.3, 1e-4, 0}}},
      {"square", {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}},
      {"long", {{0, 0, 0}, {5, 0, 0}, {5, 1, 0}, {0, 1, 0}}},
      {"high", {{0, 0, 0}, {1, 0, 0}, {1.5, 6, 0}, {0, 5, 0}}},
      {"trapezoid", {{0, 0, 0}, {2, 0, 0}, {1.2, 1, 0}, {0.4, 1, 0}}},
      {"kite", {{0, 0, 0}, {1, 0.2, 0}, {1.6, 1.7, 0}, {0.1, 0.9, 0}}},
  };
  const Eigen::Matrix3d turn = Eigen::Quaterniond(0.7, 0.3, -0.5, 0.2).normalized().toRotationMatrix();
  for (Shape& shape : shapes) {
    for (Vec3& corner : shape.corners) {
      corner = turn * corner;
    }
  }
  return shapes;
}

/// A scene of one patch and its hierarchy, divided twice.
struct OnePatch {
  explicit OnePatch(const Shape& shape) {
    Scene scene;
    Surface surface;
    surface.material = testing::AddMaterial(scene, 0.5, 1);
    surface.positions = shape.corners;
    for (Index k = 1; k + 1 < shape.corners.size(); ++k) {
      surface.triangles.push_back({0, k, k + 1});
    }
    scene.surfaces.push_back(surface);
    patches = CutIntoPatches(scene);
    hierarchy.emplace(patches);
    const Index first = hierarchy->Divide(0);
    for (Index child = first; child < first + 4; ++child) {
      hierarchy->Divide(child);
    }
  }
  Patches patches;
  std::optional<Hierarchy> hierarchy;
};

/// Mean of a polynomial of any degree up to 4 over a polygon, by the rule on ever finer triangles: nothing of
/// the code under test.
double Mean(const Polygon& polygon, const std::function<double(const Vec3&)>& f) {
  constexpr int kSteps = 64;
  double sum = 0;
  double area = 0;
  for (int k = 1; k + 1 < polygon.count; ++k) {
    const Vec3 a = polygon[k] - polygon[0];
    const Vec3 b = polygon[k + 1] - polygon[0];
    const double size = a.cross(b).norm();
    area += size;
    double part = 0;
    for (int i = 0; i < kSteps; ++i) {
      for (int j = 0; i + j < kSteps; ++j) {
        part += f(polygon[0] + ((i + 1.0 / 3) * a + (j + 1.0 / 3) * b) / kSteps);
        if (i + j + 1 < kSteps) {
          part += f(polygon[0] + ((i + 2.0 / 3) * a + (j + 2.0 / 3) * b) / kSteps);
        }
      }
    }
    sum += size * part / (kSteps * kSteps);
  }
  return sum / area;
}

TEST(Basis, IsOrthonormalOverEveryShape) {
  for (const Shape& shape : Shapes()) {
    const OnePatch scene(shape);
    for (const BasisOrder order : kHigher) {
      Basis basis(order);
      basis.Extend(*scene.hierarchy);
      for (const Index e : {Index{0}, Index{1}, Index{4}, Index{7}, Index{12}}) {
        for (std::size_t i = 0; i < basis.count(); ++i) {
          for (std::size_t j = i; j < basis.count(); ++j) {
            const double mean = Mean(scene.hierarchy->Shape(e), [&](const Vec3& x) {
              const BasisValues values = basis.At(e, x);
              return values[i] * values[j];
            });
            EXPECT_NEAR(mean, i == j ? 1 : 0, 3e-3) << shape.name << " " << i << " " << j;
          }
        }
      }
    }
  }
}

TEST(Basis, RulesSumProductsOfTwoExactly) {
  for (const Shape& shape : Shapes()) {
    const OnePatch scene(shape);
    for (const BasisOrder order : kHigher) {
      Basis basis(order);
      basis.Extend(*scene.hierarchy);
      for (Index e = 0; e < scene.hierarchy->size(); ++e) {
        const Quadrature rule(scene.hierarchy->Shape(e), ProductDegree(basis.count()));
        for (std::size_t i = 0; i < basis.count(); ++i) {
          for (std::size_t j = i; j < basis.count(); ++j) {
            double sum = 0;
            for (const QuadraturePoint& point : rule.points()) {
              const BasisValues values = basis.At(e, point.x);
              EXPECT_GT(point.weight, 0);
              sum += point.weight * values[i] * values[j];
            }
            EXPECT_NEAR(sum, i == j ? 1 : 0, 1e-6) << shape.name;
          }
        }
      }
    }
  }
}

/// A polynomial of the degree of the order in all three coordinates.
Rgb SomePolynomial(BasisOrder order, const Vec3& x) {
  Rgb value(1 + 2 * x[0] - x[1] + 0.5 * x[2], -x[0] + 3 * x[1], 0.25 - x[2] + x[1]);
  if (order == BasisOrder::kQuadratic) {
    value += Rgb(x[0] * x[1] - 2 * x[2] * x[2], x[1] * x[1] + x[0] * x[2], 3 * x[0] * x[0]);
  }
  return value;
}

std::vector<Rgb> Projected(const Basis& basis, BasisOrder order, const Hierarchy& hierarchy, Index e) {
  std::vector<Rgb> coefficients(basis.count(), Rgb::Zero());
  const Quadrature rule(hierarchy.Shape(e), ProductDegree(basis.count()));
  for (const QuadraturePoint& point : rule.points()) {
    const BasisValues values = basis.At(e, point.x);
    for (std::size_t k = 0; k < basis.count(); ++k) {
      coefficients[k] += point.weight * values[k] * SomePolynomial(order, point.x);
    }
  }
  return coefficients;
}

double LargestDifference(const std::vector<Rgb>& a, const std::vector<Rgb>& b) {
  double largest = 0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    largest = std::max(largest, (a[k] - b[k]).abs().maxCoeff());
  }
  return largest;
}

TEST(Basis, HoldsAPolynomialOfItsOrderExactlyAndKeepsItInPushAndPull) {
  for (const Shape& shape : Shapes()) {
    const OnePatch scene(shape);
    const Hierarchy& hierarchy = *scene.hierarchy;
    for (const BasisOrder order : kHigher) {
      Basis basis(order);
      basis.Extend(hierarchy);
      for (Index e = 0; e < hierarchy.size(); ++e) {
        const std::vector<Rgb> known = Projected(basis, order, hierarchy, e);
        QuasiRandom<2> random(e);
        for (int k = 0; k < 8; ++k) {
          const auto u = random.Next();
          const Vec3 x = PointOn(hierarchy.Shape(e), u[0], u[1]);
          EXPECT_LT((Evaluate(known, basis.At(e, x)) - SomePolynomial(order, x)).abs().maxCoeff(), 1e-7)
              << shape.name;
        }
        if (hierarchy[e].IsLeaf()) {
          continue;
        }
        std::vector<Rgb> pulled(basis.count(), Rgb::Zero());
        for (Index child = hierarchy[e].first_child; child < hierarchy[e].first_child + 4; ++child) {
          const std::vector<Rgb> below = Projected(basis, order, hierarchy, child);
          std::vector<Rgb> pushed(basis.count(), Rgb::Zero());
          PushTo(basis, child, known, pushed);
          EXPECT_LT(LargestDifference(pushed, below), 1e-7) << shape.name << ", child " << child;
          PullFrom(basis, child, hierarchy[child].area / hierarchy[e].area, below, pulled);
        }
        EXPECT_LT(LargestDifference(pulled, known), 1e-7) << shape.name;
      }
    }
  }
}

TEST(Basis, PullsUpTheBestFitOfWhatItCannotHold) {
  // The parent's coefficients of a function that is linear on each child: the means of φ·f.
  for (const Shape& shape : Shapes()) {
    const OnePatch scene(shape);
    const Hierarchy& hierarchy = *scene.hierarchy;
    Basis basis(BasisOrder::kLinear);
    basis.Extend(hierarchy);
    const Index first = hierarchy[0].first_child;
    const std::array<std::array<double, 3>, 4> on_child = {
        {{1, 0.5, 0}, {2, 0, -1}, {0, 1, 1}, {4, 0, 0.25}}};
    std::vector<Rgb> pulled(3, Rgb::Zero());
    std::array<double, 3> expected{};
    for (Index k = 0; k < 4; ++k) {
      const Index child = first + k;
      const std::vector<Rgb> own = {Rgb::Constant(on_child[k][0]), Rgb::Constant(on_child[k][1]),
                                    Rgb::Constant(on_child[k][2])};
      const double share = hierarchy[child].area / hierarchy[0].area;
      PullFrom(basis, child, share, own, pulled);
      for (std::size_t i = 0; i < 3; ++i) {
        expected[i] += share * Mean(hierarchy.Shape(child), [&](const Vec3& x) {
                         return Evaluate(own, basis.At(child, x))[0] * basis.At(0, x)[i];
                       });
      }
    }
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_NEAR(pulled[i][0], expected[i], 5e-3) << shape.name;
    }
  }
}

TEST(Basis, FlattensWhatWouldBeNegativeAndKeepsItsMean) {
  for (const Shape& shape : Shapes()) {
    const OnePatch scene(shape);
    const Polygon polygon = scene.hierarchy->Shape(0);
    Basis basis(BasisOrder::kLinear);
    basis.Extend(*scene.hierarchy);
    std::vector<Rgb> coefficients = {Rgb(1, 1, 0), Rgb(2, 0.01, 0.1), Rgb(-1, 0.02, 0)};
    KeepPositive(basis[0], polygon, coefficients);
    EXPECT_TRUE((coefficients[0] == Rgb(1, 1, 0)).all());
    EXPECT_EQ(coefficients[1][1], 0.01) << "positive as it was";
    EXPECT_EQ(coefficients[1][2], 0);
    double lowest = 1;
    for (int k = 0; k < polygon.count; ++k) {
      lowest = std::min(lowest, Evaluate(coefficients, basis.At(0, polygon[k]))[0]);
    }
    EXPECT_NEAR(lowest, 0, 1e-12) << "as steep as it may be";
    EXPECT_NEAR(coefficients[1][0] / coefficients[2][0], -2, 1e-12);
  }
}

}  // namespace
}  // namespace radbake
