// Patches of extreme shapes, sizes and positions, most of them in furnaces: where every surface emits 1 cd/m²
// and reflects ρ, E = π/(1 − ρ) wherever no light escapes.
#include "solver/check/check.h"
#include "solver/scene/duplicates.h"
#include "solver/solve/energy.h"
#include "tests/extremes/extremes_test.h"

namespace radbake {
namespace {

using std::numbers::pi;
using testing::AddBox;
using testing::AddMaterial;
using testing::AddQuad;
using testing::Bake;
using testing::Baked;
using testing::CoarseSolve;
using testing::Deviation;
using testing::DeviationFrom;
using testing::FurnaceBox;
using testing::SolvedScene;

constexpr double kReflectance = 0.5;
constexpr double kGlow = pi / (1 - kReflectance);

/// Where bodies hide parts of each other, the vertices' shadow rays leave some noise, and no bias.
void ExpectGlow(const Deviation& deviation) {
  EXPECT_LT(deviation.rms, 0.02);
  EXPECT_LT(std::abs(deviation.mean), 0.003);
}

/// The floor of FurnaceBox(), without it: the rest of the box is open downwards.
Scene WithoutFloor() {
  Scene scene = FurnaceBox(kReflectance);
  scene.surfaces.erase(scene.surfaces.begin());
  return scene;
}

/// Adds triangles of one surface on the floor, looking up.
void AddFloor(Scene& scene, std::vector<Vec3> positions, std::vector<Triangle> triangles) {
  Surface surface;
  surface.name = "floor";
  surface.positions = std::move(positions);
  surface.triangles = std::move(triangles);
  scene.surfaces.push_back(surface);
}

TEST(Extremes, AFloorOfSliversGlowsEvenly) {
  // Strips of 1 m × 10 µm beside each other, and the rest.
  Scene scene = WithoutFloor();
  double x = 0;
  for (int i = 0; i < 4; ++i, x += 1e-5) {
    AddQuad(scene, 0, {x, 0, 0}, {x, 0, 1}, {x + 1e-5, 0, 1}, {x + 1e-5, 0, 0});
  }
  AddQuad(scene, 0, {x, 0, 0}, {x, 0, 1}, {1, 0, 1}, {1, 0, 0});
  EXPECT_LT(DeviationFrom(Bake(scene), kGlow).worst, 1e-3);
}

TEST(Extremes, AFloorWithASliverForATriangleGlowsEvenly) {
  Scene scene = WithoutFloor();
  AddFloor(scene, {{0, 0, 0}, {0, 0, 1}, {1, 0, 1}, {1, 0, 0}, {0.5, 0, 0.5 + 1e-5}},
           {{0, 1, 4}, {1, 2, 4}, {0, 4, 2}, {0, 2, 3}});
  EXPECT_LT(DeviationFrom(Bake(scene), kGlow).worst, 1e-3);
}

TEST(Extremes, PatchesWhoseAreasDifferByTenDecadesGlowEvenly) {
  // A square of 10 µm in the middle of the floor, and four quadrilaterals around it.
  Scene scene = WithoutFloor();
  const double a = 0.5 - 5e-6;
  const double b = 0.5 + 5e-6;
  const Vec3 outer[] = {{0, 0, 0}, {0, 0, 1}, {1, 0, 1}, {1, 0, 0}};
  const Vec3 inner[] = {{a, 0, a}, {a, 0, b}, {b, 0, b}, {b, 0, a}};
  AddQuad(scene, 0, inner[0], inner[1], inner[2], inner[3]);
  for (int i = 0; i < 4; ++i) {
    AddQuad(scene, 0, outer[i], outer[(i + 1) % 4], inner[(i + 1) % 4], inner[i]);
  }
  EXPECT_LT(DeviationFrom(Bake(scene), kGlow).worst, 1e-3);
}

TEST(Extremes, TrianglesWithoutAreaChangeNothing) {
  Scene scene = FurnaceBox(kReflectance);
  for (Surface& surface : scene.surfaces) {
    surface.triangles.push_back({0, 0, 1});
    surface.triangles.push_back({2, 2, 2});
    surface.positions.push_back((surface.positions[0] + surface.positions[2]) / 2);
    surface.triangles.push_back({0, 4, 2});
  }
  EXPECT_LT(DeviationFrom(Bake(scene), kGlow).worst, 1e-3);
}

TEST(Extremes, DuplicateTrianglesChangeNothing) {
  Scene scene = FurnaceBox(kReflectance);
  for (Surface& surface : scene.surfaces) {
    surface.triangles.push_back(surface.triangles[0]);
  }
  scene.surfaces.push_back(scene.surfaces[2]);
  EXPECT_EQ(DropDuplicates(scene), 9U);
  EXPECT_LT(DeviationFrom(Bake(scene), kGlow).worst, 1e-3);
}

TEST(Extremes, SurfacesThatOverlapInOnePlaneShineOnce) {
  // Two floors over one another in a half of the room, and a rug a third of a micrometre above them both.
  Scene scene = WithoutFloor();
  AddQuad(scene, 0, {0, 0, 0}, {0, 0, 1}, {0.75, 0, 1}, {0.75, 0, 0});
  AddQuad(scene, 0, {0.25, 0, 0}, {0.25, 0, 1}, {1, 0, 1}, {1, 0, 0});
  AddQuad(scene, 0, {0.4, 3e-8, 0.4}, {0.4, 3e-8, 0.6}, {0.6, 3e-8, 0.6}, {0.6, 3e-8, 0.4});
  SolvedScene solved(scene, CoarseSolve());
  EXPECT_LT(BalanceEnergy(solved.hierarchy, solved.solution.light, solved.visibility).imbalance, 5e-3);
  ExpectGlow(DeviationFrom(Bake(scene, solved), kGlow));
}

TEST(Extremes, ASheetOfTwoFacesBackToBackGlowsOnBoth) {
  Scene scene = FurnaceBox(kReflectance);
  AddQuad(scene, 0, {0.2, 0.4, 0.3}, {0.2, 0.4, 0.6}, {0.7, 0.4, 0.6}, {0.7, 0.4, 0.3});
  scene.surfaces.push_back(scene.surfaces.back());
  for (Triangle& triangle : scene.surfaces.back().triangles) {
    std::swap(triangle[0], triangle[1]);
  }
  EXPECT_EQ(DropDuplicates(scene), 0U);
  ExpectGlow(DeviationFrom(Bake(scene), kGlow));
}

TEST(Extremes, BodiesThatTouchAlongAnEdgeGlowEvenly) {
  Scene scene = FurnaceBox(kReflectance);
  AddBox(scene, 0, Vec3(0.2, 0.2, 0.2), Vec3(0.4, 0.4, 0.4), false);
  AddBox(scene, 0, Vec3(0.4, 0.4, 0.2), Vec3(0.6, 0.6, 0.4), false);
  ExpectGlow(DeviationFrom(Bake(scene), kGlow));
}

TEST(Extremes, BodiesThatTouchInAPointGlowEvenly) {
  Scene scene = FurnaceBox(kReflectance);
  AddBox(scene, 0, Vec3(0.2, 0.2, 0.2), Vec3(0.4, 0.4, 0.4), false);
  AddBox(scene, 0, Vec3(0.4, 0.4, 0.4), Vec3(0.6, 0.6, 0.6), false);
  ExpectGlow(DeviationFrom(Bake(scene), kGlow));
}

TEST(Extremes, BodiesThatInterpenetrateGlowWhereTheyAreSeen) {
  Scene scene = FurnaceBox(kReflectance);
  const Eigen::AlignedBox3d a(Vec3(0.2, 0.2, 0.2), Vec3(0.5, 0.5, 0.5));
  const Eigen::AlignedBox3d b(Vec3(0.4, 0.3, 0.4), Vec3(0.7, 0.6, 0.7));
  AddBox(scene, 0, a.min(), a.max(), false);
  AddBox(scene, 0, b.min(), b.max(), false);
  const auto margin = [](const Eigen::AlignedBox3d& box, const Vec3& p) {  // inside: above 0
    return (p - box.min()).cwiseMin(box.max() - p).minCoeff();
  };
  const Baked baked = Bake(scene);
  // Not what is hidden, nor where an edge of one goes into the other.
  const Deviation deviation = DeviationFrom(baked, [&](std::size_t, const Vec3& p) {
    return std::min(margin(a, p), margin(b, p)) > -1e-3 || std::max(margin(a, p), margin(b, p)) > 1e-3
               ? 0
               : kGlow;
  });
  ExpectGlow(deviation);
}

TEST(Extremes, ATubeOfOneTo200GlowsEvenly) {
  Scene scene;
  AddBox(scene, AddMaterial(scene, kReflectance, 1), Vec3(0, 0, 0), Vec3(200, 1, 1), true);
  EXPECT_LT(DeviationFrom(Bake(scene), kGlow).worst, 1e-3);
}

/// A black room of 1 m with a square lamp of `size` that looks down from the height 1 − gap.
Scene TinyLamp(double size, double gap) {
  Scene scene;
  AddBox(scene, AddMaterial(scene, 0, 0), Vec3(-0.5, 0, -0.5), Vec3(0.5, 1, 0.5), true);
  const double h = size / 2;
  const double y = 1 - gap;
  AddQuad(scene, AddMaterial(scene, 0, 1 / (size * size)), {-h, y, -h}, {h, y, -h}, {h, y, h}, {-h, y, h});
  return scene;
}

TEST(Extremes, ALampOfAMillionthOfTheRoomLightsItAsAPoint) {
  for (const double gap : {1e-6, 1e-3, 0.1}) {
    const Scene scene = TinyLamp(1e-6, gap);
    constexpr std::size_t kFloor = 0;
    // 1 cd straight down, as a plane lamp gives it: E = I·cos θ·cos θ′/d².
    const Deviation deviation = DeviationFrom(Bake(scene), [&](std::size_t surface, const Vec3& p) {
      const double h = 1 - gap;
      return surface == kFloor ? h * h / std::pow((p - Vec3(0, h, 0)).squaredNorm(), 2) : 0;
    });
    EXPECT_LT(deviation.worst, 1e-3) << gap;
  }
}

TEST(Extremes, ALampInContactWithAWallLightsTheRestOfTheRoom) {
  // A cube that stands on the floor; its face towards the floor is there or not.
  const auto room = [](bool face) {
    Scene scene;
    AddBox(scene, AddMaterial(scene, 0.5, 0), Vec3(0, 0, 0), Vec3(1, 1, 1), true);
    AddBox(scene, AddMaterial(scene, 0.2, 5), Vec3(0.4, 0, 0.4), Vec3(0.6, 0.2, 0.6), false);
    if (!face) {
      scene.surfaces.erase(scene.surfaces.begin() + 6);
    }
    return scene;
  };
  CheckOptions options;
  options.probes = 64;
  options.max_paths = 4096;
  for (const bool face : {false, true}) {
    const Scene scene = room(face);
    const CheckSummary summary = Check(scene, Bake(scene).triangles, options);
    EXPECT_LT(summary.error_low, 0.05) << face;
  }
}

}  // namespace
}  // namespace radbake
