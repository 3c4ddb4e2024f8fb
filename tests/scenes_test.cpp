// The scenes are what scenes/README.md says they are: the numbers there that need no solver.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <numbers>
#include <string>

#include "solver/gltf/document.h"

namespace radbake {
namespace {

namespace fs = std::filesystem;
using std::numbers::pi;

const fs::path kScenes = RADBAKE_SOURCE_DIR "/scenes";

std::string Read(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

Scene Load(const std::string& name) {
  return gltf::Document(gltf::ReadSource((kScenes / (name + ".glb")).string())).scene();
}

/// The vector area of a triangle: along its normal, as long as its area.
Vec3 VectorArea(const Surface& surface, const Triangle& triangle) {
  const Vec3& a = surface.positions[triangle[0]];
  return 0.5 * (surface.positions[triangle[1]] - a).cross(surface.positions[triangle[2]] - a);
}

double Area(const Surface& surface) {
  double area = 0;
  for (const Triangle& triangle : surface.triangles) {
    area += VectorArea(surface, triangle).norm();
  }
  return area;
}

double Area(const Scene& scene) {
  double area = 0;
  for (const Surface& surface : scene.surfaces) {
    area += Area(surface);
  }
  return area;
}

/// Σ A·π·L_e, lm.
Rgb Emitted(const Scene& scene) {
  Rgb power = Rgb::Zero();
  for (const Surface& surface : scene.surfaces) {
    power += Area(surface) * pi * scene.materials[surface.material].emission;
  }
  return power;
}

struct Integrals {
  Vec3 area = Vec3::Zero();  ///< 0 for a closed surface
  double volume = 0;         ///< negative where fronts look inward
};

Integrals Integrate(const Scene& scene) {
  Integrals integrals;
  for (const Surface& surface : scene.surfaces) {
    for (const Triangle& triangle : surface.triangles) {
      const Vec3 area = VectorArea(surface, triangle);
      integrals.area += area;
      integrals.volume += area.dot(surface.positions[triangle[0]]) / 3;
    }
  }
  return integrals;
}

const Surface& Made(const Scene& scene, const std::string& material) {
  return *std::ranges::find_if(scene.surfaces, [&](const Surface& surface) {
    return scene.materials[surface.material].name == material;
  });
}

/// Howell's catalogue, B-3: from a point with normal +y to [0, x] × [0, z] of a parallel plane, 1 m above.
double CornerFactor(double x, double z) {
  const auto half = [](double a, double b) {
    const double length = std::sqrt(1 + a * a);
    return a / length * std::atan(b / length);
  };
  return (half(x, z) + half(z, x)) / (2 * pi);
}

double RectangleFactor(double x0, double x1, double z0, double z1) {
  return CornerFactor(x1, z1) - CornerFactor(x0, z1) - CornerFactor(x1, z0) + CornerFactor(x0, z0);
}

/// The centre of a cell of an n × n grid over a parallelogram, whose corners are the surface's first
/// triangle's.
Vec3 CellCentre(const Surface& surface, int n, int i, int j) {
  const Triangle& triangle = surface.triangles[0];
  const Vec3& corner = surface.positions[triangle[1]];
  return corner + (i + 0.5) / n * (surface.positions[triangle[0]] - corner) +
         (j + 0.5) / n * (surface.positions[triangle[2]] - corner);
}

/// The integrand of the form factor, cos θ·cos θ′ / (π·r²).
double Kernel(const Vec3& from, const Vec3& from_normal, const Vec3& to, const Vec3& to_normal) {
  const Vec3 way = to - from;
  const double squared = way.squaredNorm();
  return std::max(0.0, way.dot(from_normal)) * std::max(0.0, -way.dot(to_normal)) / (pi * squared * squared);
}

/// Lambert's contour integral: from a point to triangles that lie wholly above its horizon and face it.
double PointFactor(const Vec3& from, const Vec3& normal, const Surface& to) {
  double sum = 0;
  for (const Triangle& triangle : to.triangles) {
    for (std::size_t i = 0; i < 3; ++i) {
      const Vec3 a = (to.positions[triangle[i]] - from).normalized();
      const Vec3 b = (to.positions[triangle[(i + 1) % 3]] - from).normalized();
      sum -= std::acos(std::clamp(a.dot(b), -1.0, 1.0)) * normal.dot(a.cross(b).normalized());
    }
  }
  return sum / (2 * pi);
}

/// The mean form factor from the receiver to the emitter, by midpoints.
double MeanFactor(const Scene& scene) {
  constexpr int kCells = 200;
  const Surface& receiver = Made(scene, "receiver");
  const Vec3 normal = VectorArea(receiver, receiver.triangles[0]).normalized();
  double sum = 0;
  for (int i = 0; i < kCells; ++i) {
    for (int j = 0; j < kCells; ++j) {
      sum += PointFactor(CellCentre(receiver, kCells, i, j), normal, Made(scene, "emitter"));
    }
  }
  return sum / kCells / kCells;
}

TEST(Scenes, ComeOutOfTheScriptByteForByte) {
  std::string folder = (fs::temp_directory_path() / "radbake-scenes-XXXXXX").string();
  ASSERT_NE(mkdtemp(folder.data()), nullptr);
  const std::string command = "python3 -B '" RADBAKE_SOURCE_DIR "/scenes/make_scenes.py' '" + folder + "'";
  ASSERT_EQ(std::system(command.c_str()), 0);  // NOLINT(concurrency-mt-unsafe)
  std::size_t made = 0;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    EXPECT_EQ(Read(entry.path()), Read(kScenes / entry.path().filename())) << entry.path().filename();
    ++made;
  }
  const auto committed = std::ranges::count_if(
      fs::directory_iterator(kScenes), [](const auto& entry) { return entry.path().extension() == ".glb"; });
  EXPECT_EQ(made, static_cast<std::size_t>(committed));
  EXPECT_EQ(made, 10U);
  fs::remove_all(folder);
}

TEST(Scenes, FurnacesAreClosedAndTheSameEverywhere) {
  for (const auto& [name, volume] : {std::pair{"furnace-box", -6.0}, std::pair{"furnace-sphere", -4.047}}) {
    const Scene scene = Load(name);
    const Integrals integrals = Integrate(scene);
    EXPECT_LT(integrals.area.norm(), 1e-6) << name;
    EXPECT_NEAR(integrals.volume, volume, 1e-3) << name;
    ASSERT_EQ(scene.materials.size(), 1U) << name;
    EXPECT_TRUE((scene.materials[0].reflectance == 0.5).all()) << name;
    EXPECT_TRUE((scene.materials[0].emission == 100).all()) << name;
  }
}

TEST(Scenes, PlatesHaveTheFormFactorsOfTheCatalogue) {
  EXPECT_NEAR(MeanFactor(Load("plates-parallel")), 0.1998249, 2e-6);
  EXPECT_NEAR(MeanFactor(Load("plates-perpendicular")), 0.2000438, 2e-6);
}

TEST(Scenes, TheClosedFormOfThePointFactorGivesTheCatalogueMean) {
  constexpr int kCells = 200;
  double sum = 0;
  for (int i = 0; i < kCells; ++i) {
    for (int j = 0; j < kCells; ++j) {
      const double x = (i + 0.5) / kCells - 0.5;
      const double z = (j + 0.5) / kCells - 0.5;
      sum += RectangleFactor(-0.5 - x, 0.5 - x, -0.5 - z, 0.5 - z);
    }
  }
  EXPECT_NEAR(sum / kCells / kCells, 0.1998249, 1e-6);
  EXPECT_NEAR(100 * pi * RectangleFactor(-0.5, 0.5, -0.5, 0.5), 75.22747, 1e-5);
}

TEST(Scenes, TheOccludedPlateHidesWhatTheClosedFormSays) {
  const Scene scene = Load("plates-occluded");
  const Surface& emitter = Made(scene, "emitter");
  const Surface& blocker = Made(scene, "blocker");
  EXPECT_EQ(scene.materials[blocker.material].sides, Sides::kBoth);
  const double half = std::abs(blocker.positions[0].x());
  const Vec3 down(0, -1, 0);
  const auto is_hidden = [&](const Vec3& from, const Vec3& to) {
    const double t = (blocker.positions[0].y() - from.y()) / (to.y() - from.y());
    const Vec3 at = from + t * (to - from);
    return std::abs(at.x()) < half && std::abs(at.z()) < half;
  };
  constexpr int kCells = 400;
  for (const auto& [x, z] : {std::pair{0.0, 0.0}, std::pair{0.2, -0.1}, std::pair{0.5, 0.35}}) {
    double sum = 0;
    for (int i = 0; i < kCells; ++i) {
      for (int j = 0; j < kCells; ++j) {
        const Vec3 to = CellCentre(emitter, kCells, i, j);
        sum += is_hidden({x, 0, z}, to) ? 0 : Kernel({x, 0, z}, -down, to, down);
      }
    }
    const auto on_emitter = [](double a) { return std::clamp(a, -0.5, 0.5); };
    const double closed = RectangleFactor(-0.5 - x, 0.5 - x, -0.5 - z, 0.5 - z) -
                          RectangleFactor(on_emitter(-x - 0.25) - x, on_emitter(-x + 0.25) - x,
                                          on_emitter(-z - 0.25) - z, on_emitter(-z + 0.25) - z);
    EXPECT_NEAR(sum / kCells / kCells, closed, 1e-3 * closed) << x << ", " << z;
    if (x == 0) {
      EXPECT_NEAR(closed, 0.1659788, 1e-7);
    }
  }
}

TEST(Scenes, TwoRoomsKeepTheirLightAndShowTheSecondRoomNoneOfIt) {
  const Scene scene = Load("two-rooms");
  EXPECT_LT(Integrate(scene).area.norm(), 1e-5);
  EXPECT_NEAR(Integrate(scene).volume, -(2 * 4 * 2.7 * 4 + 0.2 * 0.9 * 2) + 0.87 * 0.04 * 1.98, 1e-4);
  EXPECT_NEAR(Area(scene), 151.6332, 1e-4);

  const Rgb reflectance = scene.materials[0].reflectance;
  for (const Material& material : scene.materials) {
    EXPECT_TRUE((material.reflectance == reflectance).all()) << material.name;
  }
  const Rgb mean = Emitted(scene) / ((1 - reflectance) * Area(scene));
  EXPECT_NEAR(mean[0], 110.498, 1e-3);
  EXPECT_NEAR(mean[1], 94.713, 1e-3);
  EXPECT_NEAR(mean[2], 82.873, 1e-3);

  const Surface& light = Made(scene, "light");
  const Vec3 normal = VectorArea(light, light.triangles[0]).normalized();
  std::size_t of_second_room = 0;
  for (const Surface& surface : scene.surfaces) {
    for (const Vec3& position : surface.positions) {
      if (position.x() > 4.1) {
        EXPECT_LT(normal.dot(position - light.positions[0]), -0.1);
        ++of_second_room;
      }
    }
  }
  EXPECT_GT(of_second_room, 20U);
}

TEST(Scenes, ATubeKeepsItsLight) {
  const Scene scene = Load("tube");
  EXPECT_NEAR(Integrate(scene).volume, -200, 1e-4);
  EXPECT_NEAR(Emitted(scene)[1] / (0.5 * Area(scene)), 0.7834396, 1e-6);
}

TEST(Scenes, ThreeLightsHaveAChannelEach) {
  const Scene scene = Load("three-lights");
  ASSERT_EQ(scene.lights.size(), 3U);
  // E at the floor's centre, whose normal is +y.
  Rgb sum = Rgb::Zero();
  for (const PunctualLight& light : scene.lights) {
    const bool sun = light.kind == PunctualLight::Kind::kDirectional;
    const Vec3 to = sun ? light.direction : Vec3(-light.position);
    const double distance = sun ? 1 : to.norm();
    sum += light.intensity * light.Attenuation(to) * -to.y() / std::pow(distance, 3);
  }
  EXPECT_NEAR(sum[0], 100, 1e-5);
  EXPECT_NEAR(sum[1], 9.777951, 1e-5);
  EXPECT_NEAR(sum[2], 70.71068, 1e-5);
  EXPECT_TRUE(scene.lights[2].direction.isApprox(Vec3(1, -1, 0).normalized(), 1e-12));

  const Surface& screen = Made(scene, "screen");
  EXPECT_EQ(scene.materials[screen.material].sides, Sides::kBoth);
  const auto shadow = [&](std::size_t light, const Vec3& from) {
    const PunctualLight& l = scene.lights[light];
    const bool sun = l.kind == PunctualLight::Kind::kDirectional;
    const Vec3 way = sun ? l.direction : Vec3(from - l.position);
    return Vec3(from + way * (from.y() / -way.y()));
  };
  Eigen::AlignedBox3d boxes[3];
  for (const Vec3& corner : screen.positions) {
    for (std::size_t light = 0; light < 3; ++light) {
      boxes[light].extend(shadow(light, corner));
    }
  }
  EXPECT_TRUE(boxes[0].min().isApprox(Vec3(-2.5, 0, -0.5), 1e-6));
  EXPECT_TRUE(boxes[0].max().isApprox(Vec3(-1.5, 0, 0.5), 1e-6));
  EXPECT_TRUE(boxes[1].min().isApprox(Vec3(-5.0 / 3, 0, -2.0 / 3), 1e-6));
  EXPECT_LT((boxes[1].max() - Vec3(-1, 0, 0)).norm(), 1e-6);
  EXPECT_TRUE(boxes[2].min().isApprox(Vec3(-0.75, 0, -0.25), 1e-6));
  EXPECT_TRUE(boxes[2].max().isApprox(Vec3(-0.25, 0, 0.25), 1e-6));
}

TEST(Scenes, TheRoomWithAWindowIsClosedButForIt) {
  const Scene scene = Load("window-room");
  const Integrals integrals = Integrate(scene);
  EXPECT_LT((integrals.area - Vec3(1.44, 0, 0)).norm(), 1e-5);
  EXPECT_NEAR(pi * 1000 * integrals.area.x(), 4523.893, 1e-2);
  EXPECT_NEAR(integrals.volume, -4 * 2.7 * 3 + 4 * 1.44 / 3, 1e-4);
  // Of the window as a surface that looks in.
  Surface window;
  window.positions = {{4, 0.9, 0.9}, {4, 0.9, 2.1}, {4, 2.1, 2.1}, {4, 2.1, 0.9}};
  window.triangles = {{0, 1, 2}, {0, 2, 3}};
  EXPECT_NEAR(PointFactor({3, 0, 1.5}, Vec3::UnitY(), window), 0.06470431, 1e-8);
  EXPECT_NEAR(PointFactor({2, 0, 1.5}, Vec3::UnitY(), window), 0.03272847, 1e-8);
  EXPECT_NEAR(pi * 1000 * 0.06470431, 203.2746, 1e-4);
}

TEST(Scenes, AFurnishedRoomIsMadeOnDemand) {
  std::string folder = (fs::temp_directory_path() / "radbake-room-XXXXXX").string();
  ASSERT_NE(mkdtemp(folder.data()), nullptr);
  const std::string file = folder + "/room.glb";
  const std::string command =
      "python3 -B '" RADBAKE_SOURCE_DIR "/scenes/make_room.py' 10000 '" + file + "' > '" + folder + "/said'";
  const int status = std::system(command.c_str());  // NOLINT(concurrency-mt-unsafe)
  const std::string said = Read(folder + "/said");
  ASSERT_EQ(status, 0);
  const Scene scene = gltf::Document(gltf::ReadSource(file)).scene();
  fs::remove_all(folder);
  EXPECT_EQ(said, "9980 triangles in 190 objects\n");
  std::size_t triangles = 0;
  for (const Surface& surface : scene.surfaces) {
    triangles += surface.triangles.size();
  }
  EXPECT_EQ(triangles, 9980U);
  // All of it is closed, the shell with its fronts inward; the furniture takes a little of the room.
  const Integrals integrals = Integrate(scene);
  EXPECT_LT(integrals.area.norm(), 1e-4);
  EXPECT_NEAR(integrals.volume, -8 * 2.8 * 6, 4);
  const Rgb emitted = Emitted(scene);
  EXPECT_NEAR(emitted[0], 31667.25, 0.1);
  EXPECT_NEAR(emitted[1], 31365.66, 0.1);
  EXPECT_NEAR(emitted[2], 30159.29, 0.1);
}

TEST(Scenes, TheCornellBoxHasItsLightAndItsRedWallOnTheLeft) {
  const Scene scene = Load("cornell-box");
  const Rgb emitted = Emitted(scene);
  EXPECT_NEAR(emitted[0], 729.007, 1e-2);
  EXPECT_NEAR(emitted[1], 514.593, 1e-2);
  EXPECT_NEAR(emitted[2], 171.531, 1e-2);
  // The camera looks along +z with y up, so that its left is +x.
  for (const Vec3& position : Made(scene, "red").positions) {
    EXPECT_GT(position.x(), 0.5);
  }
  for (const Vec3& position : Made(scene, "green").positions) {
    EXPECT_EQ(position.x(), 0);
  }
}

}  // namespace
}  // namespace radbake
