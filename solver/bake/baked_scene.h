/// What a bake makes of a scene: each surface divided where the light needs it, with irradiance at vertices.
#pragma once

#include <array>
#include <vector>

#include "solver/scene/types.h"

namespace radbake {

/// A vertex of the output: a weighted sum of up to four vertices of its input surface (unused: weight 0). The
/// weights are dyadic fractions that sum to 1, so that interpolating float attributes in double is exact, and
/// two elements that share an edge get the same bits.
struct BakedVertex {
  std::array<Index, 4> source{};
  std::array<float, 4> weight{};
  Eigen::Array3f irradiance = Eigen::Array3f::Zero();  ///< E in lx, unclamped, not negative
};

/// Triangles are wound as the input surface's front is, for a back side the other way round.
struct BakedMesh {
  std::vector<BakedVertex> vertices;
  std::vector<Triangle> triangles;
};

/// `back` has triangles only for a surface lit on both sides (Sides::kBoth). Both are empty for a
/// Role::kBlocker surface and for one without a triangle of positive area: it is left as it is.
struct BakedSurface {
  BakedMesh front;
  BakedMesh back;
};

/// One BakedSurface for each surface of the scene, in its order.
struct BakedScene {
  std::vector<BakedSurface> surfaces;
  double exposure = 1;  ///< displayed value 1 = radiance × exposure, per cd/m²
};

/// The baked surface as a viewer interpolates it: vertices with irradiance, linear over each triangle.
struct BakedTriangles {
  std::vector<Vec3> positions;
  std::vector<Rgb> irradiance;  ///< lx
  std::vector<Triangle> triangles;
};

}  // namespace radbake
