/// Two plates in a basis, and how they couple.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "solver/transport/coupling.h"
#include "tests/test_scenes.h"

namespace radbake::testing {

/// Two patches, each with a basis.
struct PlatePair {
  PlatePair(const std::array<Vec3, 4>& a, const std::array<Vec3, 4>& b, BasisOrder order) {
    Scene scene;
    const Index material = AddMaterial(scene, 0.5, 1);
    AddQuad(scene, material, a[0], a[1], a[2], a[3]);
    AddQuad(scene, material, b[0], b[1], b[2], b[3]);
    patches = CutIntoPatches(scene);
    hierarchy.emplace(patches);
    basis = Basis(order);
    basis.Extend(*hierarchy);
  }

  std::vector<float> Coupled() const {
    std::vector<float> couplings(basis.count() * (basis.count() - 1));
    CoupleShaped({*hierarchy, basis, 0}, {*hierarchy, basis, 1}, basis.count(), couplings);
    return couplings;
  }

  Patches patches;
  std::optional<Hierarchy> hierarchy;
  Basis basis;
};

inline const std::array<Vec3, 4> kFloorPlate = {Vec3(0, 0, 0), Vec3(0, 0, 1), Vec3(1, 0, 1), Vec3(1, 0, 0)};

inline std::array<Vec3, 4> CeilingPlate(double height) {
  return {Vec3(0.3, height, 0), Vec3(1.3, height, 0), Vec3(1.3, height, 0.8), Vec3(0.3, height, 0.8)};
}
inline std::array<Vec3, 4> WallPlate(double distance, double base) {
  return {Vec3(-distance, base, 0), Vec3(-distance, base + 1, 0), Vec3(-distance, base + 1, 1),
          Vec3(-distance, base, 1)};
}

}  // namespace radbake::testing
