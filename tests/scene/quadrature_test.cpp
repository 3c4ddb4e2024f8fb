#include "solver/scene/quadrature.h"

#include <gtest/gtest.h>

#include <cmath>

namespace radbake {
namespace {

Polygon Shape(std::initializer_list<Vec3> corners) {
  Polygon polygon;
  for (const Vec3& corner : corners) {
    polygon[polygon.count++] = corner;
  }
  polygon.normal = Vec3::UnitZ();
  return polygon;
}

/// ∫ x^a·y^b over the unit square cut by y = 1 − cut·x: in closed form.
double Integral(int a, int b, double cut) {
  // ∫_0^1 x^a·(1 − cut·x)^(b+1)/(b+1) dx, by the binomial sum.
  double sum = 0;
  double choose = 1;
  for (int k = 0; k <= b + 1; ++k) {
    sum += choose * std::pow(-cut, k) / (a + k + 1);
    choose *= static_cast<double>(b + 1 - k) / (k + 1);
  }
  return sum / (b + 1);
}

TEST(Quadrature, IsExactUpToItsDegree) {
  for (const double cut : {0.0, 0.4, 1.0}) {
    // A square, a trapezium, and the triangle that is left where its right edge has no length.
    const Polygon shape = cut == 1 ? Shape({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}})
                                   : Shape({{0, 0, 0}, {1, 0, 0}, {1, 1 - cut, 0}, {0, 1, 0}});
    for (const int degree : {2, 4}) {
      const Quadrature rule(shape, degree);
      EXPECT_NEAR(rule.area(), Integral(0, 0, cut), 1e-15);
      for (int a = 0; a <= degree; ++a) {
        for (int b = 0; a + b <= degree; ++b) {
          double sum = 0;
          for (const QuadraturePoint& point : rule.points()) {
            sum += point.weight * std::pow(point.x.x(), a) * std::pow(point.x.y(), b);
          }
          EXPECT_NEAR(rule.area() * sum, Integral(a, b, cut), 1e-14)
              << "x^" << a << " y^" << b << ", degree " << degree << ", cut " << cut;
        }
      }
    }
  }
}

TEST(Quadrature, OfDegreeZeroIsTheMiddle) {
  const Polygon shape = Shape({{0, 0, 0}, {2, 0, 0}, {2, 1, 0}, {0, 1, 0}});
  const Quadrature rule(shape, 0);
  ASSERT_EQ(rule.points().size(), 1U);
  EXPECT_EQ(rule.points()[0].x, Vec3(1, 0.5, 0));
  EXPECT_DOUBLE_EQ(rule.area(), 2);
}

}  // namespace
}  // namespace radbake
