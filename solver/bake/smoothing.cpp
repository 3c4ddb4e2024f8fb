#include "solver/bake/smoothing.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "solver/bake/element_centre.h"

namespace radbake {
namespace {

/// The vertices and the centres of the fans, as one row of nodes, and who is whose neighbour.
class Nodes {
 public:
  explicit Nodes(const OutputMesh& mesh) : mesh_(mesh), vertices_(mesh.hierarchy().vertex_count()) {
    begin_.assign(vertices_ + mesh.cut().size() + 1, 0);
    ForEachPair([&](std::size_t a, std::size_t /*b*/) { ++begin_[a + 1]; });
    for (std::size_t k = 1; k < begin_.size(); ++k) {
      begin_[k] += begin_[k - 1];
    }
    neighbours_.resize(begin_.back());
    std::vector<std::size_t> end(begin_.begin(), begin_.end() - 1);
    ForEachPair([&](std::size_t a, std::size_t b) { neighbours_[end[a]++] = static_cast<Index>(b); });
  }

  std::size_t size() const { return begin_.size() - 1; }
  std::size_t vertices() const { return vertices_; }
  bool IsVertex(std::size_t node) const { return node < vertices_; }
  Index ElementOf(std::size_t centre) const { return mesh_.cut()[centre - vertices_]; }
  /// Some twice; none of what is not in the mesh.
  std::span<const Index> Around(std::size_t node) const {
    return std::span(neighbours_).subspan(begin_[node], begin_[node + 1] - begin_[node]);
  }
  const OutputMesh::Sample& At(std::size_t node) const {
    return IsVertex(node) ? mesh_.AtVertex(static_cast<Index>(node)) : mesh_.AtCentre(ElementOf(node));
  }
  Vec3 Place(std::size_t node) const {
    return IsVertex(node) ? mesh_.hierarchy().Point(static_cast<Index>(node))
                          : ElementCentre(mesh_.hierarchy().Shape(ElementOf(node)));
  }

 private:
  template <typename Visit>
  void ForEachPair(const Visit& visit) const {
    for (std::size_t k = 0; k < mesh_.cut().size(); ++k) {
      const OutputMesh::Loop& loop = mesh_.loops()[k];
      const std::size_t centre = vertices_ + k;
      for (std::size_t v = 0; v < loop.size(); ++v) {
        const Index next = loop[(v + 1) % loop.size()];
        visit(loop[v], next);
        visit(next, loop[v]);
        if (loop.size() > 3) {
          visit(loop[v], centre);
          visit(centre, loop[v]);
        }
      }
    }
  }

  const OutputMesh& mesh_;
  std::size_t vertices_;
  std::vector<std::size_t> begin_;
  std::vector<Index> neighbours_;
};

/// A smooth function through what is at some places, by least squares: a linear one, and of a quadratic one's
/// further terms so much as the points' scatter does not explain.
class Regression {
 public:
  explicit Regression(Vec3 origin) : origin_(std::move(origin)) {}

  void Add(const Vec3& place, const OutputMesh::Sample& sample) {
    points_.push_back({place - origin_, &sample});
  }

  struct Answer {
    Rgb value = Rgb::Zero();  // of the function at the origin
    double own = 0;           // share of the first point in that
    double variance = 0;      // of `value`, from the others' own
    double scatter = 0;       // mean square of the points from it, a degree of freedom
    double noise = 0;         // the same, as their variances tell
  };

  /// Nothing if the points do not tell.
  std::optional<Answer> Solve() const {
    constexpr std::size_t kLeast = 9;
    if (points_.size() < kLeast) {
      return std::nullopt;
    }
    // Along the two directions in which the points extend most: of a curved surface, its tangents.
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    for (const Point& point : points_) {
      spread += point.offset * point.offset.transpose();
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(spread);
    constexpr double kThin = 1e-3;
    if (!(axes.eigenvalues()[1] > kThin * axes.eigenvalues()[2])) {
      return std::nullopt;
    }
    const auto count = static_cast<double>(points_.size());
    const Vec3 u = axes.eigenvectors().col(2) * std::sqrt(count / axes.eigenvalues()[2]);
    const Vec3 v = axes.eigenvectors().col(1) * std::sqrt(count / axes.eigenvalues()[1]);
    const Fit<3> linear = Through<3>(u, v);
    const Fit<6> quadratic = Through<6>(u, v);
    // Points in two rows, say, allow of many.
    constexpr double kSingular = 1e-6;
    if (!(quadratic.condition > kSingular)) {
      return std::nullopt;
    }
    Answer answer;
    answer.scatter = quadratic.left / (count - 6);
    const double curvature = (linear.left - quadratic.left) / 3;
    const double curved = curvature > answer.scatter ? 1 - answer.scatter / curvature : 0;
    for (const Point& point : points_) {
      const double a = u.dot(point.offset);
      const double b = v.dot(point.offset);
      const double weight = (1 - curved) * linear.inverse.row(0).dot(Row<3>(a, b)) +
                            curved * quadratic.inverse.row(0).dot(Row<6>(a, b));
      answer.value += weight * point.sample->irradiance;
      answer.noise += point.sample->variance / count;
      if (&point == &points_.front()) {
        answer.own = weight;
      } else {
        answer.variance += weight * weight * point.sample->variance;
      }
    }
    return answer;
  }

 private:
  struct Point {
    Vec3 offset;
    const OutputMesh::Sample* sample;
  };
  template <int kTerms>
  struct Fit {
    Eigen::Matrix<double, kTerms, kTerms> inverse;  // of the normal equations' matrix
    double left;                                    // sum of the squares
    double condition;                               // reciprocal, of that matrix
  };

  template <int kTerms>
  static Eigen::Matrix<double, kTerms, 1> Row(double u, double v) {
    Eigen::Matrix<double, kTerms, 1> row;
    if constexpr (kTerms == 3) {
      row << 1, u, v;
    } else {
      row << 1, u, v, u * u, u * v, v * v;
    }
    return row;
  }

  template <int kTerms>
  Fit<kTerms> Through(const Vec3& u, const Vec3& v) const {
    Eigen::Matrix<double, kTerms, kTerms> normal = Eigen::Matrix<double, kTerms, kTerms>::Zero();
    Eigen::Matrix<double, kTerms, 3> right = Eigen::Matrix<double, kTerms, 3>::Zero();
    for (const Point& point : points_) {
      const auto row = Row<kTerms>(u.dot(point.offset), v.dot(point.offset));
      normal += row * row.transpose();
      right += row * point.sample->irradiance.matrix().transpose();
    }
    const Eigen::LDLT<Eigen::Matrix<double, kTerms, kTerms>> factors(normal);
    Fit<kTerms> fit{factors.solve(Eigen::Matrix<double, kTerms, kTerms>::Identity()), 0, factors.rcond()};
    const Eigen::Matrix<double, kTerms, 3> coefficients = fit.inverse * right;
    for (const Point& point : points_) {
      const auto row = Row<kTerms>(u.dot(point.offset), v.dot(point.offset));
      fit.left += (point.sample->irradiance.matrix() - coefficients.transpose() * row).squaredNorm();
    }
    return fit;
  }

  Vec3 origin_;
  std::vector<Point> points_;
};

/// With its neighbours and theirs, that are not far.
std::optional<Regression::Answer> Around(const Nodes& nodes, std::size_t node) {
  constexpr double kFar = 2.1;  // of the mean neighbour's distance
  const Vec3 x = nodes.Place(node);
  double mean = 0;
  std::vector<Index> around;
  for (const Index near : nodes.Around(node)) {
    mean += (nodes.Place(near) - x).norm() / static_cast<double>(nodes.Around(node).size());
    around.push_back(near);
    for (const Index next : nodes.Around(near)) {
      around.push_back(next);
    }
  }
  std::sort(around.begin(), around.end());
  around.erase(std::unique(around.begin(), around.end()), around.end());
  Regression regression(x);
  regression.Add(x, nodes.At(node));
  for (const Index other : around) {
    const Vec3 y = nodes.Place(other);
    if (other != node && !nodes.At(other).sealed && (y - x).norm() < kFar * mean) {
      regression.Add(y, nodes.At(other));
    }
  }
  return regression.Solve();
}

}  // namespace

void SmoothNoise(OutputMesh& mesh) {
  const Nodes nodes(mesh);
  std::vector<OutputMesh::Sample> smooth(nodes.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, nodes.size()), [&](const auto& range) {
    for (std::size_t node = range.begin(); node != range.end(); ++node) {
      if (nodes.Around(node).empty()) {
        continue;
      }
      OutputMesh::Sample& sample = smooth[node];
      sample = nodes.At(node);
      if (sample.sealed || !(sample.variance > 0)) {
        continue;
      }
      if (const auto function = Around(nodes, node)) {
        const double explained =
            function->noise < function->scatter ? function->noise / function->scatter : 1.0;
        sample.irradiance += explained * (function->value - sample.irradiance);
        sample.variance *= std::pow(1 - explained * (1 - function->own), 2);
        sample.variance += explained * explained * function->variance;
      }
    }
  });
  for (std::size_t node = 0; node < nodes.size(); ++node) {
    if (!nodes.Around(node).empty()) {
      nodes.IsVertex(node) ? mesh.SetAtVertex(static_cast<Index>(node), smooth[node])
                           : mesh.SetAtCentre(nodes.ElementOf(node), smooth[node]);
    }
  }
}

}  // namespace radbake
