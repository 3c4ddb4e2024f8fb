#include "solver/solve/krylov.h"

#include <Eigen/IterativeLinearSolvers>
#include <Eigen/SparseCore>
#include <algorithm>
#include <unsupported/Eigen/IterativeSolvers>

namespace radbake {
class ScaledSystem;
}

template <>
struct Eigen::internal::traits<radbake::ScaledSystem> : Eigen::internal::traits<Eigen::SparseMatrix<double>> {
};

namespace radbake {

/// I − ρK as Eigen's solvers take a matrix: on vectors of all leaves' channels, in which the Euclidean norm
/// is that by area, and each patch and channel is measured by its own light.
class ScaledSystem : public Eigen::EigenBase<ScaledSystem> {
 public:
  // The names are Eigen's.
  // NOLINTBEGIN(readability-identifier-naming)
  using Scalar = double;
  using RealScalar = double;
  using StorageIndex = int;
  enum { ColsAtCompileTime = Eigen::Dynamic, MaxColsAtCompileTime = Eigen::Dynamic, IsRowMajor = 0 };
  Eigen::Index rows() const { return 3 * operator_.size(); }
  Eigen::Index cols() const { return rows(); }
  // NOLINTEND(readability-identifier-naming)

  ScaledSystem(const RadiosityOperator& radiosity_operator, const LeafValues& measures)
      : operator_(radiosity_operator), scale_(3, radiosity_operator.size()) {
    const Rgb brightest = measures.rowwise().maxCoeff();
    const Rgb unreached = (brightest > 0).select(1 / brightest, 1);
    for (Eigen::Index k = 0; k < operator_.size(); ++k) {
      const Rgb measure = measures.col(k);
      scale_.col(k) = std::sqrt(operator_.areas()[k]) * (measure > 0).select(1 / measure, unreached);
    }
  }

  Eigen::VectorXd ToVector(const LeafValues& values) const {
    const LeafValues scaled = scale_ * values;
    return Eigen::Map<const Eigen::VectorXd>(scaled.data(), rows());
  }
  LeafValues ToValues(const Eigen::VectorXd& vector) const {
    return Eigen::Map<const LeafValues>(vector.data(), 3, operator_.size()) / scale_;
  }

  Eigen::VectorXd operator*(const Eigen::VectorXd& x) const {
    if (x.isZero(0)) {
      return x;  // the first guess
    }
    ++applications_;
    return x - ToVector(operator_.reflectance() * operator_.Gather(ToValues(x)));
  }
  std::size_t applications() const { return applications_; }

 private:
  const RadiosityOperator& operator_;
  LeafValues scale_;
  mutable std::size_t applications_ = 0;
};

namespace {

constexpr std::size_t kMaxApplications = 1000;
/// Vectors that GMRES keeps.
constexpr Eigen::Index kRestart = 16;

LeafValues Reflected(const RadiosityOperator& radiosity_operator, const LeafValues& irradiance) {
  return radiosity_operator.emission() + radiosity_operator.reflectance() * irradiance;
}

/// The solution d of (I − ρK)·d = residual.
LeafValues Correction(const RadiosityOperator& radiosity_operator, const LeafValues& residual,
                      const LeafValues& measures, double tolerance, std::size_t& applications) {
  const ScaledSystem system(radiosity_operator, measures);
  Eigen::GMRES<ScaledSystem, Eigen::IdentityPreconditioner> gmres(system);
  const Eigen::Index restart = std::min(kRestart, system.rows() - 1);
  gmres.set_restart(restart);
  gmres.setMaxIterations(restart);
  gmres.setTolerance(tolerance);
  const Eigen::VectorXd solution = gmres.solve(system.ToVector(residual));
  applications += system.applications();
  // Without anything left to find it may divide by zero; a sweep is always right.
  return solution.allFinite() ? system.ToValues(solution) : residual;
}

}  // namespace

Convergence IterateByKrylov(const RadiosityOperator& radiosity_operator, const IterationOptions& options,
                            Light& light) {
  const double enough = (1 - radiosity_operator.largest_reflectance()) * options.tolerance;
  Convergence convergence;
  LeafValues radiosity = radiosity_operator.Radiosity(light);
  // By the brightest that a patch has been: one that loses its light again, as in a cavity without light, has
  // no light that an error could be relative to.
  LeafValues measures = LeafValues::Zero(3, radiosity_operator.size());
  for (;;) {
    const LeafValues irradiance = radiosity_operator.Gather(radiosity);
    ++convergence.applications;
    const LeafValues swept = Reflected(radiosity_operator, irradiance);
    const LeafValues residual = swept - radiosity;
    measures = measures.max(radiosity_operator.LocalMeans(swept));
    convergence.residual = radiosity_operator.RelativeRms(residual, measures).maxCoeff();
    if (convergence.residual <= enough || convergence.applications >= kMaxApplications ||
        (options.stop && options.stop(convergence))) {
      radiosity_operator.Store(irradiance, light);
      return convergence;
    }
    // √3: what GMRES sees is all channels' residual.
    radiosity += Correction(radiosity_operator, residual, measures,
                            enough / (std::sqrt(3.0) * convergence.residual), convergence.applications);
  }
}

std::size_t BytesOfIteration(std::size_t columns) {
  // Those that GMRES keeps, one more and its own six; and those of the two functions above.
  constexpr std::size_t kVectors = kRestart + 1 + 6 + 7;
  return kVectors * columns * sizeof(Rgb);
}

Convergence IterateBySweeps(const RadiosityOperator& radiosity_operator, const IterationOptions& options,
                            Light& light) {
  Convergence convergence;
  LeafValues radiosity = radiosity_operator.Radiosity(light);
  double previous = 0;
  for (;;) {
    const LeafValues irradiance = radiosity_operator.Gather(radiosity);
    ++convergence.applications;
    LeafValues swept = Reflected(radiosity_operator, irradiance);
    convergence.residual =
        radiosity_operator.RelativeRms(swept - radiosity, radiosity_operator.LocalMeans(swept)).maxCoeff();
    const double ratio = previous > 0 ? convergence.residual / previous : 1;
    previous = convergence.residual;
    // The first sweeps spread light that the later ones only damp: their ratio says nothing yet.
    constexpr std::size_t kFirstSweeps = 3;
    if (convergence.residual == 0 || convergence.applications >= kMaxApplications ||
        (convergence.applications > kFirstSweeps && ratio < 1 &&
         convergence.residual * ratio / (1 - ratio) < options.tolerance) ||
        (options.stop && options.stop(convergence))) {
      radiosity_operator.Store(irradiance, light);
      return convergence;
    }
    radiosity = std::move(swept);
  }
}

}  // namespace radbake
