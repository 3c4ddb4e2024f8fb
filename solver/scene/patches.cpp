#include "solver/scene/patches.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <tuple>

namespace radbake {
namespace {

// Float vertex positions carry a relative error of 2^-24; two vertices of the unit-sized scene that are
// closer than this cannot be told apart.
constexpr double kWeld = 2e-7;

// Largest distance of a fourth corner from the plane of the other three, relative to the quadrilateral's
// size.
constexpr double kPlanar = 1e-6;

Vec3 AreaVector(const Vec3& a, const Vec3& b, const Vec3& c) {
  return 0.5 * (b - a).cross(c - a);
}

Normalization Normalize(const Scene& scene) {
  Eigen::AlignedBox3d box;
  for (const Surface& surface : scene.surfaces) {
    for (const Triangle& triangle : surface.triangles) {
      for (const Index vertex : triangle) {
        box.extend(surface.positions[vertex]);
      }
    }
  }
  Normalization result;
  if (box.isEmpty() || box.sizes().maxCoeff() <= 0) {
    throw InputError("the scene has no triangle of positive area");
  }
  result.centre = box.center();
  result.scale = 1 / box.sizes().maxCoeff();
  return result;
}

/// A triangle of a surface with its world-space corners replaced by normalised ones.
struct Face {
  std::array<Vec3, 3> corner;
  Vec3 area_vector;
};

/// The quadrilateral a, b, c, d made of `first` and the triangle that shares its edge (a, c).
struct Merge {
  double shared_length = 0;
  Index first = 0;
  Index second = 0;
  std::array<Index, 4> source{};
};

class SurfaceCutter {
 public:
  SurfaceCutter(const Surface& surface, const Normalization& normalization) : surface_(surface) {
    points_.reserve(surface.positions.size());
    for (const Vec3& position : surface.positions) {
      points_.push_back(normalization.ToNormalized(position));
    }
    for (const Triangle& t : surface.triangles) {
      faces_.push_back({{points_[t[0]], points_[t[1]], points_[t[2]]},
                        AreaVector(points_[t[0]], points_[t[1]], points_[t[2]])});
    }
  }

  bool HasArea(Index triangle) const {
    const Face& face = faces_[triangle];
    const double longest = std::max({(face.corner[1] - face.corner[0]).squaredNorm(),
                                     (face.corner[2] - face.corner[1]).squaredNorm(),
                                     (face.corner[0] - face.corner[2]).squaredNorm()});
    return face.area_vector.norm() > 1e-12 * longest && longest > 0;
  }

  /// For each triangle the quadrilateral that it became a half of, as an index into merges(), or kNone.
  std::vector<Index> MergePairs() {
    std::map<std::pair<Index, Index>, std::vector<Index>> edges;
    for (Index t = 0; t < surface_.triangles.size(); ++t) {
      if (HasArea(t)) {
        for (std::size_t k = 0; k < 3; ++k) {
          edges[std::minmax(surface_.triangles[t][k], surface_.triangles[t][(k + 1) % 3])].push_back(t);
        }
      }
    }
    std::vector<Merge> candidates;
    for (const auto& [edge, users] : edges) {
      Merge merge;
      if (users.size() == 2 && FormsQuadrilateral(users[0], users[1], merge)) {
        candidates.push_back(merge);
      }
    }
    // Longest shared edge first: that is the diagonal along which exporters cut quadrilaterals.
    std::sort(candidates.begin(), candidates.end(), [](const Merge& a, const Merge& b) {
      return std::tie(b.shared_length, a.first, a.second) < std::tie(a.shared_length, b.first, b.second);
    });
    std::vector<Index> merged(surface_.triangles.size(), kNone);
    for (const Merge& merge : candidates) {
      if (merged[merge.first] == kNone && merged[merge.second] == kNone) {
        merged[merge.first] = merged[merge.second] = static_cast<Index>(merges_.size());
        merges_.push_back(merge);
      }
    }
    return merged;
  }

  const std::vector<Merge>& merges() const { return merges_; }
  const Face& face(Index triangle) const { return faces_[triangle]; }

  Patch MakePatch(const std::vector<Index>& source) const {
    Patch patch;
    patch.corner_count = static_cast<int>(source.size());
    Vec3 area_vector = Vec3::Zero();
    for (std::size_t k = 0; k < source.size(); ++k) {
      patch.source[k] = source[k];
      patch.corner[k] = points_[source[k]];
      area_vector += 0.5 * (points_[source[k]] - points_[source[0]])
                               .cross(points_[source[(k + 1) % source.size()]] - points_[source[0]]);
    }
    patch.area = area_vector.norm();
    patch.normal = area_vector / patch.area;
    for (std::size_t k = 0; k < source.size(); ++k) {
      patch.shading_normal[k] = surface_.normals.empty() ? patch.normal : surface_.normals[source[k]];
    }
    return patch;
  }

 private:
  bool FormsQuadrilateral(Index first, Index second, Merge& merge) const {
    const Triangle& t = surface_.triangles[first];
    const Triangle& u = surface_.triangles[second];
    for (std::size_t k = 0; k < 3; ++k) {
      // The shared edge runs from t[k] to t[k + 1], and the other way round in u.
      for (std::size_t m = 0; m < 3; ++m) {
        if (t[k] == u[(m + 1) % 3] && t[(k + 1) % 3] == u[m]) {
          merge = {(points_[t[k]] - points_[t[(k + 1) % 3]]).norm(),
                   first,
                   second,
                   {t[k], u[(m + 2) % 3], t[(k + 1) % 3], t[(k + 2) % 3]}};
          return IsConvexAndPlanar(merge.source) && AttributesAreAffine(merge.source);
        }
      }
    }
    return false;
  }

  bool IsConvexAndPlanar(const std::array<Index, 4>& quad) const {
    const Vec3 normal = (points_[quad[2]] - points_[quad[0]]).cross(points_[quad[3]] - points_[quad[1]]);
    const double size = normal.norm();  // twice the area
    double perimeter = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      const Vec3 in = points_[quad[k]] - points_[quad[(k + 3) % 4]];
      const Vec3 out = points_[quad[(k + 1) % 4]] - points_[quad[k]];
      perimeter += out.norm();
      // Each corner must turn left by a clear angle: a straight one makes the bilinear map singular.
      if (in.cross(out).dot(normal) <= 0.05 * in.norm() * out.norm() * size) {
        return false;
      }
    }
    const double off =
        (points_[quad[2]] - points_[quad[0]])
            .dot((points_[quad[1]] - points_[quad[0]]).cross(points_[quad[3]] - points_[quad[0]])) /
        size;
    return std::abs(off) <= kPlanar * perimeter + kWeld;
  }

  /// Bilinear interpolation over the quadrilateral must give what the two triangles gave: the attributes, the
  /// shading normals and the position have to be affine over it.
  bool AttributesAreAffine(const std::array<Index, 4>& quad) const {
    // Barycentric coordinates of quad[3] in the triangle of the other three.
    const Vec3 e1 = points_[quad[1]] - points_[quad[0]];
    const Vec3 e2 = points_[quad[2]] - points_[quad[0]];
    const Vec3 d = points_[quad[3]] - points_[quad[0]];
    const Vec3 n = e1.cross(e2);
    const double b1 = d.cross(e2).dot(n) / n.squaredNorm();
    const double b2 = e1.cross(d).dot(n) / n.squaredNorm();
    const std::array<double, 3> weight = {1 - b1 - b2, b1, b2};
    const auto affine = [&](const auto& at, double tolerance) {
      double expected = 0;
      for (std::size_t k = 0; k < 3; ++k) {
        expected += weight[k] * at(quad[k]);
      }
      return std::abs(expected - at(quad[3])) <= tolerance;
    };
    for (std::size_t c = 0; c < surface_.attribute_width; ++c) {
      const auto at = [&](Index v) {
        return static_cast<double>(surface_.attributes[v * surface_.attribute_width + c]);
      };
      if (!affine(at, 1e-4 * (1 + std::abs(at(quad[3]))))) {
        return false;
      }
    }
    if (!surface_.normals.empty()) {
      for (Eigen::Index c = 0; c < 3; ++c) {
        if (!affine([&](Index v) { return surface_.normals[v][c]; }, 1e-3)) {
          return false;
        }
      }
    }
    return true;
  }

  const Surface& surface_;
  std::vector<Vec3> points_;
  std::vector<Face> faces_;
  std::vector<Merge> merges_;
};

Patch BackOf(const Patch& front) {
  Patch back = front;
  back.back = true;
  back.normal = -front.normal;
  const auto count = static_cast<std::size_t>(front.corner_count);
  for (std::size_t k = 0; k < count; ++k) {
    back.source[k] = front.source[count - 1 - k];
    back.corner[k] = front.corner[count - 1 - k];
    back.shading_normal[k] = -front.shading_normal[count - 1 - k];
  }
  return back;
}

/// Six squares that look inwards.
void AddSky(const Rgb& radiance, Patches& patches) {
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    for (const double side : {-1.0, 1.0}) {
      Patch patch;
      patch.surface = kNone;
      patch.corner_count = 4;
      patch.normal = -side * Vec3::Unit(axis);
      const Vec3 u = Vec3::Unit((axis + 1) % 3);
      const Vec3 v = patch.normal.cross(u);
      const Vec3 middle = side * Vec3::Unit(axis);
      patch.corner = {kSkyDistance * (middle - u - v), kSkyDistance * (middle + u - v),
                      kSkyDistance * (middle + u + v), kSkyDistance * (middle - u + v)};
      patch.shading_normal.fill(patch.normal);
      patch.area = 4 * kSkyDistance * kSkyDistance;
      patch.emission = std::numbers::pi * radiance;
      patches.patches.push_back(patch);
    }
  }
}

/// Luminous power of the sky and of what has no area, about as much of it as meets the unit-sized scene.
double AddDistantLight(const Scene& scene, Patches& patches) {
  double power = 0;
  if (scene.environment.maxCoeff() > 0) {
    AddSky(scene.environment, patches);
    power += std::numbers::pi * Luminance(scene.environment);
  }
  for (PunctualLight light : scene.lights) {
    if (!(light.intensity.maxCoeff() > 0)) {
      continue;
    }
    const Normalization& unit = patches.normalization;
    if (light.kind == PunctualLight::Kind::kDirectional) {
      power += Luminance(light.intensity);
    } else {
      light.position = unit.ToNormalized(light.position);
      light.range *= unit.scale;
      light.intensity *= unit.scale * unit.scale;
      power += 4 * std::numbers::pi * Luminance(light.intensity);
    }
    patches.lights.push_back(light);
  }
  return power;
}

}  // namespace

Patches CutIntoPatches(const Scene& scene) {
  Patches result;
  result.normalization = Normalize(scene);
  result.weld = kWeld;
  double power = 0;
  for (Index s = 0; s < scene.surfaces.size(); ++s) {
    const Surface& surface = scene.surfaces[s];
    const Material& material = scene.materials[surface.material];
    SurfaceCutter cutter(surface, result.normalization);
    const std::vector<Index> merged = cutter.MergePairs();
    std::vector<std::array<Index, 2>> patches_of_merge(cutter.merges().size(), {kNone, kNone});
    for (Index t = 0; t < surface.triangles.size(); ++t) {
      if (!cutter.HasArea(t)) {
        continue;
      }
      std::array<Index, 2> sides = {kNone, kNone};
      if (merged[t] != kNone && patches_of_merge[merged[t]][0] != kNone) {
        sides = patches_of_merge[merged[t]];
      } else if (material.role == Role::kDiffuse) {
        std::vector<Index> source(surface.triangles[t].begin(), surface.triangles[t].end());
        if (merged[t] != kNone) {
          source.assign(cutter.merges()[merged[t]].source.begin(), cutter.merges()[merged[t]].source.end());
        }
        Patch patch = cutter.MakePatch(source);
        patch.surface = s;
        patch.emission = material.emission * std::numbers::pi;
        patch.reflectance = material.reflectance;
        sides[0] = static_cast<Index>(result.patches.size());
        result.patches.push_back(patch);
        if (material.sides == Sides::kBoth) {
          sides[1] = static_cast<Index>(result.patches.size());
          result.patches.push_back(BackOf(patch));
        }
        for (Index side = sides[0]; side < result.patches.size(); ++side) {
          result.area += patch.area;
          power += patch.area * Luminance(patch.emission);
        }
        if (merged[t] != kNone) {
          patches_of_merge[merged[t]] = sides;
        }
      }
      result.blockers.push_back({cutter.face(t).corner, sides[0], sides[1]});
    }
  }
  if (result.patches.empty()) {
    throw InputError("the scene has no surface that can be lit");
  }
  result.surface_patches = result.patches.size();
  power += AddDistantLight(scene, result);
  if (!(power > 0)) {
    throw InputError(
        "nothing in the scene emits light: no material has an emissiveFactor above 0, there is no punctual "
        "light, and environment.radiance is 0");
  }
  result.normalization.radiance = power;
  for (Patch& patch : result.patches) {
    patch.emission /= power;
  }
  for (PunctualLight& light : result.lights) {
    light.intensity /= power;
  }
  return result;
}

}  // namespace radbake
