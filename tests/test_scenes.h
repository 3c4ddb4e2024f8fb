/// Small scenes with known answers, made in code.
#pragma once

#include <numbers>

#include "solver/scene/scene.h"

namespace radbake::testing {

inline Index AddMaterial(Scene& scene, double reflectance, double emission) {
  Material material;
  material.reflectance = Rgb::Constant(reflectance);
  material.emission = Rgb::Constant(emission);
  scene.materials.push_back(material);
  return static_cast<Index>(scene.materials.size() - 1);
}

/// A quadrilateral of two triangles as a surface of its own; counter-clockwise from its front.
inline void AddQuad(Scene& scene, Index material, const Vec3& a, const Vec3& b, const Vec3& c,
                    const Vec3& d) {
  Surface surface;
  surface.name = "quad " + std::to_string(scene.surfaces.size());
  surface.material = material;
  surface.positions = {a, b, c, d};
  surface.triangles = {{0, 1, 2}, {0, 2, 3}};
  scene.surfaces.push_back(surface);
}

/// An axis-aligned box of six quadrilaterals, fronts inwards or outwards.
inline void AddBox(Scene& scene, Index material, const Vec3& low, const Vec3& high, bool inwards) {
  const auto corner = [&](int x, int y, int z) {
    return Vec3(x != 0 ? high[0] : low[0], y != 0 ? high[1] : low[1], z != 0 ? high[2] : low[2]);
  };
  const auto add = [&](const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
    inwards ? AddQuad(scene, material, a, b, c, d) : AddQuad(scene, material, d, c, b, a);
  };
  add(corner(0, 0, 0), corner(0, 0, 1), corner(1, 0, 1), corner(1, 0, 0));  // floor, up
  add(corner(0, 1, 0), corner(1, 1, 0), corner(1, 1, 1), corner(0, 1, 1));  // ceiling, down
  add(corner(0, 0, 0), corner(0, 1, 0), corner(0, 1, 1), corner(0, 0, 1));  // low x, to +x
  add(corner(1, 0, 0), corner(1, 0, 1), corner(1, 1, 1), corner(1, 1, 0));  // high x, to −x
  add(corner(0, 0, 0), corner(1, 0, 0), corner(1, 1, 0), corner(0, 1, 0));  // low z, to +z
  add(corner(0, 0, 1), corner(0, 1, 1), corner(1, 1, 1), corner(1, 0, 1));  // high z, to −z
}

/// A closed box whose every surface emits 1 cd/m² and reflects ρ: E = π/(1 − ρ) everywhere.
inline Scene FurnaceBox(double reflectance) {
  Scene scene;
  AddBox(scene, AddMaterial(scene, reflectance, 1), Vec3(0, 0, 0), Vec3(1, 1, 1), true);
  return scene;
}

/// The same for an icosphere of 20·4^levels triangles, fronts inwards.
inline Scene FurnaceSphere(double reflectance, int levels) {
  Scene scene;
  Surface sphere;
  sphere.name = "sphere";
  sphere.material = AddMaterial(scene, reflectance, 1);
  const double t = std::numbers::phi;
  std::vector<Vec3>& p = sphere.positions;
  p = {{-1, t, 0},  {1, t, 0},  {-1, -t, 0}, {1, -t, 0}, {0, -1, t},  {0, 1, t},
       {0, -1, -t}, {0, 1, -t}, {t, 0, -1},  {t, 0, 1},  {-t, 0, -1}, {-t, 0, 1}};
  std::vector<Triangle> faces = {{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                                 {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                                 {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                                 {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
  for (int level = 0; level < levels; ++level) {
    std::vector<Triangle> finer;
    const auto middle = [&](Index a, Index b) {
      const Vec3 m = 0.5 * (p[a] + p[b]);
      for (Index k = 0; k < p.size(); ++k) {
        if ((p[k] - m).norm() < 1e-9) {
          return k;
        }
      }
      p.push_back(m);
      return static_cast<Index>(p.size() - 1);
    };
    for (const Triangle& f : faces) {
      const Index ab = middle(f[0], f[1]);
      const Index bc = middle(f[1], f[2]);
      const Index ca = middle(f[2], f[0]);
      finer.insert(finer.end(), {{f[0], ab, ca}, {ab, f[1], bc}, {ca, bc, f[2]}, {ab, bc, ca}});
    }
    faces = finer;
  }
  for (Vec3& position : p) {
    position.normalize();
    sphere.normals.push_back(-position);
  }
  for (const Triangle& f : faces) {
    sphere.triangles.push_back({f[0], f[2], f[1]});  // inwards
  }
  scene.surfaces.push_back(sphere);
  return scene;
}

/// A room of 2 × 2 × 2 m with a lamp below its ceiling and a slab that throws a shadow on the floor; one wall
/// is red. Closed.
inline Scene ShadowRoom() {
  Scene scene;
  const Index white = AddMaterial(scene, 0.7, 0);
  AddBox(scene, white, Vec3(0, 0, 0), Vec3(2, 2, 2), true);
  const Index red = AddMaterial(scene, 0.5, 0);
  scene.materials[red].reflectance = Rgb(0.6, 0.1, 0.1);
  scene.surfaces[2].material = red;
  const Index lamp = AddMaterial(scene, 0, 100);
  AddQuad(scene, lamp, Vec3(0.7, 1.9, 0.7), Vec3(1.3, 1.9, 0.7), Vec3(1.3, 1.9, 1.3), Vec3(0.7, 1.9, 1.3));
  AddBox(scene, white, Vec3(0.6, 0.7, 0.6), Vec3(1.2, 0.8, 1.2), false);
  return scene;
}

}  // namespace radbake::testing
