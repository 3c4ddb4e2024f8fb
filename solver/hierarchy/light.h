/// The light on the element hierarchy: a mean for each node, that of its children by area, and in a higher
/// basis a polynomial.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "solver/hierarchy/basis.h"
#include "solver/hierarchy/hierarchy.h"

namespace radbake {

/// How open the patches are to what lies outside the clusters above them: the light of a link to a cluster
/// does not reach the cavities inside it.
struct Openness {
  static constexpr std::size_t kRays = 16;
  /// By patch, of rays that leave it with cosine-weighted directions: 0, or one more than the depth of the
  /// deepest cluster above the patch whose sphere holds what the ray meets.
  std::vector<std::array<std::uint8_t, kRays>> blocked_at;
  /// Of the same rays: 0, or one more than the depth of the deepest cluster above both the patch and the one
  /// that the ray meets.
  std::vector<std::array<std::uint8_t, kRays>> met_at;

  /// The share of the patch's rays that come out of its ancestor at `depth`.
  double Share(Index patch, std::uint32_t depth) const;
  /// The share of those that meet a patch below that ancestor: what the ancestor gives itself comes from
  /// there.
  double Enclosed(Index patch, std::uint32_t depth) const;
};

/// What leaves a cluster: it depends on the direction.
struct ClusterRadiosity {
  RgbCosineSum by_direction =
      RgbCosineSum::Zero();  ///< Σ A·o·B·y(n) / Σ A over the patches below, o: openness
  Rgb mean = Rgb::Zero();    ///< of B by area

  /// The mean radiosity of what is seen from the direction with this CosineBasis. `aperture`: Light's. Linear
  /// in B, so it may be a little below 0.
  Rgb Towards(const CosineSum& basis, const CosineSum& aperture) const;
};

/// Of the patches below a cluster; `shooting` by patch.
ClusterRadiosity RadiosityOf(const Hierarchy& hierarchy, const Openness& openness, Index cluster,
                             std::span<const Rgb> shooting);

/// Fills in an element's coefficients of φ_1 … from its children's (K an element). Its mean, and what the
/// children hold, must be there; a child without an open part counts as the mean.
void PullCoefficients(const Hierarchy& hierarchy, const Basis& basis, std::span<const double> open,
                      Index element, std::span<Rgb> coefficients);

/// Indexed by element, in normalised units.
struct Light {
  Basis basis;
  std::vector<Rgb> radiosity;     ///< B = π·L_e + ρ·E
  std::vector<Rgb> irradiance;    ///< E, from the links of the element, its ancestors and its descendants
  std::vector<double> variation;  ///< RMS deviation of the leaves' luminous radiosity from the mean of the
                                  ///< open part, or from the polynomial
  /// Share of the element that any light can reach, in [0, 1]; what lies sealed under a box has none. An
  /// element's irradiance falls on its open part alone, and only that shoots.
  std::vector<double> open;

  /// The element whose open part stands for this one's: itself, or where so little is open that its light is
  /// hardly known, as along the foot of a body, the nearest ancestor of which more is. For who looks at the
  /// solution: in it, each keeps its own power.
  std::vector<Index> seen_as;

  /// Radiosity of the open part: what a receiver that sees the element sees.
  Rgb Shooting(Index element) const {
    const Index as = seen_as[element];
    return open[as] > 0 ? Rgb(radiosity[as] / open[as]) : Rgb::Zero();
  }

  // If K > 1, K coefficients an element. Leaves that are not all open have their mean alone.
  std::vector<Rgb> shooting_coefficients;  ///< radiosity of the open part
  std::vector<Rgb> lighting_coefficients;  ///< E; of leaves only
  ConstCoefficients ShootingPolynomial(Index element) const {
    return std::span(shooting_coefficients).subspan(basis.count() * element, basis.count());
  }
  ConstCoefficients LightingPolynomial(Index leaf) const {
    return std::span(lighting_coefficients).subspan(basis.count() * leaf, basis.count());
  }
  /// Has it a polynomial of degree 1 or more, for who looks at the solution?
  bool IsShaped(Index element) const { return basis.count() > 1 && seen_as[element] == element; }

  std::vector<Rgb> punctual;  ///< intensities, by light: see PunctualLight
  // By cluster:
  std::vector<ClusterRadiosity> cluster_radiosity;
  std::vector<double> cluster_variation;  ///< as `variation`, over the patches below
  std::vector<CosineSum> aperture;        ///< Σ A·o·y(n) / Σ A: what faces the light, and what is seen
  std::vector<double> enclosed;  ///< Σ A·e / Σ A, e: the share that the cluster's own patches enclose
  Openness openness;             ///< filled in by whoever makes the light

  /// What a receiver at `x` sees of any node: its radiosity in that direction, or the intensity.
  Rgb Shooting(const Hierarchy& hierarchy, Index node, const Vec3& x) const;

  /// Fills in everything above the leaves from the leaves' radiosity, irradiance and variation.
  void Pull(const Hierarchy& hierarchy);
  /// Fills in the open share of everything above the leaves from theirs, and what follows from it.
  void PullOpen(const Hierarchy& hierarchy);

  /// Grows with the hierarchy: what is new starts with its parent's radiosity, a root with its emission;
  /// and open, until the solver has looked.
  void Extend(const Hierarchy& hierarchy);

  /// Of memory that grows with the elements: not those by cluster.
  std::size_t Bytes() const;

 private:
  void PullElement(const Hierarchy& hierarchy, Index element);
  double DeviationOfChild(Index parent, Index child) const;
  void PullClusters(const Hierarchy& hierarchy);
};

/// Unit vector from `x` to the middle of a node or to a light.
Vec3 DirectionTo(const Hierarchy& hierarchy, Index node, const Vec3& x);

}  // namespace radbake
