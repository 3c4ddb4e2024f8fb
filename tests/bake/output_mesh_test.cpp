#include "solver/bake/output_mesh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <tuple>
#include <utility>
#include <vector>

#include "solver/bake/emit.h"
#include "solver/bake/mesh_refinement.h"
#include "solver/transport/seen_polygon.h"
#include "tests/solve/solved_scene_test.h"
#include "tests/test_scenes.h"

namespace radbake {
namespace {

using testing::SolvedScene;

SolveOptions Quick() {
  SolveOptions options;
  options.w_min = 1e-3;
  options.a_min = 1e-4;
  return options;
}

MeshOptions Fine() {
  MeshOptions options;
  options.error = 0.03;
  options.start_area = 5e-3;
  options.min_area = 1e-6;
  return options;
}

using Place = std::tuple<float, float, float>;

/// The position that the weights give, as the export computes it: in double, then as float.
Place PlaceOf(const Surface& surface, const BakedVertex& vertex) {
  Vec3 sum = Vec3::Zero();
  for (std::size_t k = 0; k < 4; ++k) {
    if (vertex.weight[k] != 0) {
      sum += static_cast<double>(vertex.weight[k]) * surface.positions[vertex.source[k]];
    }
  }
  return {static_cast<float>(sum[0]), static_cast<float>(sum[1]), static_cast<float>(sum[2])};
}

/// How often each edge, from place to place, is used in that direction by the triangles of all surfaces.
std::map<std::pair<Place, Place>, int> DirectedEdges(const Scene& scene, const BakedScene& baked) {
  std::map<std::pair<Place, Place>, int> edges;
  for (std::size_t s = 0; s < baked.surfaces.size(); ++s) {
    const BakedMesh& mesh = baked.surfaces[s].front;
    for (const Triangle& triangle : mesh.triangles) {
      for (std::size_t k = 0; k < 3; ++k) {
        ++edges[{PlaceOf(scene.surfaces[s], mesh.vertices[triangle[k]]),
                 PlaceOf(scene.surfaces[s], mesh.vertices[triangle[(k + 1) % 3]])}];
      }
    }
  }
  return edges;
}

TEST(OutputMesh, OfAClosedRoomIsClosedBitForBitAcrossElementsAndCreases) {
  const Scene scene = testing::ShadowRoom();
  SolvedScene solved(scene, Quick());
  const BakedScene baked = solved.Output(Fine());
  Scene room = scene;
  // Every edge of the room and of the slab has its opposite; the lamp, a lone quadrilateral, has an outline.
  BakedScene without_lamp = baked;
  without_lamp.surfaces[6] = {};
  const auto edges = DirectedEdges(room, without_lamp);
  EXPECT_GT(edges.size(), 2000U);
  for (const auto& [edge, count] : edges) {
    EXPECT_EQ(count, 1);
    EXPECT_EQ(edges.count({edge.second, edge.first}), 1U) << "a crack or a T-vertex";
  }
}

TEST(OutputMesh, KeepsAreaAndWinding) {
  const Scene scene = testing::ShadowRoom();
  SolvedScene solved(scene, Quick());
  const BakedScene baked = solved.Output(Fine());
  for (std::size_t s = 0; s < scene.surfaces.size(); ++s) {
    const auto& p = scene.surfaces[s].positions;
    const Vec3 normal = (p[1] - p[0]).cross(p[2] - p[0]).normalized();
    double area = 0;
    for (const Triangle& t : baked.surfaces[s].front.triangles) {
      std::array<Vec3, 3> corner;
      for (std::size_t k = 0; k < 3; ++k) {
        const auto [x, y, z] = PlaceOf(scene.surfaces[s], baked.surfaces[s].front.vertices[t[k]]);
        corner[k] = Vec3(x, y, z);
      }
      const double signed_area = 0.5 * (corner[1] - corner[0]).cross(corner[2] - corner[0]).dot(normal);
      EXPECT_GT(signed_area, 0);
      area += signed_area;
    }
    EXPECT_NEAR(area, (p[1] - p[0]).cross(p[3] - p[0]).norm(), 1e-5);
  }
}

TEST(OutputMesh, IsContinuousOverAFlatSurfaceAndNotAcrossACrease) {
  // The floor cut into two surfaces that do not share a vertex.
  Scene scene = testing::ShadowRoom();
  const auto floor = scene.surfaces[0].positions;  // (0,0), (0,2), (2,2), (2,0)
  scene.surfaces.erase(scene.surfaces.begin());
  const Vec3 low = 0.5 * (floor[0] + floor[3]);
  const Vec3 high = 0.5 * (floor[1] + floor[2]);
  testing::AddQuad(scene, 0, floor[0], floor[1], high, low);
  testing::AddQuad(scene, 0, low, high, floor[2], floor[3]);
  SolvedScene solved(scene, Quick());
  MeshOptions options = Fine();
  options.error = 0.02;
  const BakedScene baked = solved.Output(options);
  std::map<Place, std::vector<std::pair<std::size_t, Eigen::Array3f>>> at;
  for (std::size_t s = 0; s < scene.surfaces.size(); ++s) {
    for (const BakedVertex& vertex : baked.surfaces[s].front.vertices) {
      at[PlaceOf(scene.surfaces[s], vertex)].emplace_back(s, vertex.irradiance);
    }
  }
  const std::size_t left = scene.surfaces.size() - 2;
  std::size_t on_seam = 0;
  std::size_t at_creases = 0;
  std::size_t different = 0;
  for (const auto& [place, values] : at) {
    for (std::size_t k = 1; k < values.size(); ++k) {
      const bool flat = values[0].first >= left && values[k].first >= left;
      if (flat) {
        ++on_seam;
        EXPECT_TRUE((values[0].second == values[k].second).all());
      } else {
        ++at_creases;
        different += (values[0].second != values[k].second).any() ? 1U : 0U;
      }
    }
  }
  EXPECT_GE(on_seam, 5U);
  EXPECT_GT(different, at_creases / 2);
}

TEST(OutputMesh, LetsNoLightIntoAClosedBox) {
  Scene scene = testing::ShadowRoom();
  // A sealed box in the room, its inside lined with a box whose fronts face inwards.
  const Index white = 0;
  testing::AddBox(scene, white, Vec3(1.4, 0.2, 1.4), Vec3(1.8, 0.6, 1.8), false);
  const std::size_t inside = scene.surfaces.size();
  testing::AddBox(scene, white, Vec3(1.4, 0.2, 1.4), Vec3(1.8, 0.6, 1.8), true);
  SolvedScene solved(scene, Quick());
  const BakedScene baked = solved.Output(Fine());
  for (std::size_t s = inside; s < scene.surfaces.size(); ++s) {
    for (const BakedVertex& vertex : baked.surfaces[s].front.vertices) {
      EXPECT_EQ(vertex.irradiance.maxCoeff(), 0) << scene.surfaces[s].name;
    }
  }
}

/// A room with a box on its floor, whose vertices lie under the box, on its outline or in the open.
class BoxOnAFloor {
 public:
  BoxOnAFloor(double low, double high, double error = 0.03) : low_(low), high_(high) {
    Scene scene = testing::ShadowRoom();
    scene.surfaces.resize(7);  // no slab
    testing::AddBox(scene, 0, Vec3(low, 0, low), Vec3(high, 0.5, high), false);
    SolvedScene solved(scene, Quick());
    floor_ = scene.surfaces[0];
    MeshOptions options = Fine();
    options.error = error;
    mesh_ = solved.Output(options).surfaces[0].front;
  }

  const BakedMesh& mesh() const { return mesh_; }
  /// Negative under the box, 0 on its outline.
  double Outside(Index vertex) const {
    const auto [x, y, z] = PlaceOf(floor_, mesh_.vertices[vertex]);
    return std::max({low_ - x, x - high_, low_ - z, z - high_});
  }

 private:
  double low_;
  double high_;
  Surface floor_;
  BakedMesh mesh_;
};

TEST(OutputMesh, ShowsNoDarknessFromUnderABody) {
  // Once across the elements of the floor, once along their edges.
  for (const auto& [low, high] : {std::pair{0.47, 1.19}, std::pair{0.5, 1.0}}) {
    const BoxOnAFloor box(low, high);
    int reaching_out = 0;
    for (const Triangle& triangle : box.mesh().triangles) {
      double open = 0;
      double covered = std::numeric_limits<double>::infinity();
      for (const Index vertex : triangle) {
        const double brightness = box.mesh().vertices[vertex].irradiance.maxCoeff();
        box.Outside(vertex) > 1e-6 ? open = std::max(open, brightness)
                                   : covered = std::min(covered, brightness);
      }
      if (open > 0 && std::isfinite(covered)) {
        ++reaching_out;
        EXPECT_GT(covered, 0.5 * open);
      }
    }
    EXPECT_GT(reaching_out, 20);
  }
}

TEST(OutputMesh, SpendsNoVerticesOnTheDarknessUnderABody) {
  const BoxOnAFloor box(0.47, 1.19, 0.01);
  std::size_t close_to_the_outline = 0;
  for (Index vertex = 0; vertex < box.mesh().vertices.size(); ++vertex) {
    close_to_the_outline += std::abs(box.Outside(vertex)) < 0.02 ? 1U : 0U;
  }
  EXPECT_GT(close_to_the_outline, 0);
  EXPECT_LT(close_to_the_outline, 60);
}

TEST(OutputMesh, PutsItsVerticesWhereTheLightChanges) {
  const Scene scene = testing::ShadowRoom();
  SolvedScene solved(scene, Quick());
  const BakedScene baked = solved.Output(Fine());
  // The floor lies under the slab's shadow; the slab's underside sees a floor that changes slowly.
  EXPECT_GT(baked.surfaces[0].front.vertices.size(), 4 * baked.surfaces[7].front.vertices.size());
}

TEST(OutputMesh, TakesTheLeavesAsTheyAreAndQuadraticOnesDividedOnce) {
  // A room without anything in it: a lamp is its ceiling.
  Scene scene;
  testing::AddBox(scene, testing::AddMaterial(scene, 0.5, 0), Vec3(0, 0, 0), Vec3(1, 1, 1), true);
  scene.surfaces[1].material = testing::AddMaterial(scene, 0, 1);
  std::array<double, 3> error{};
  for (const BasisOrder order : {BasisOrder::kConstant, BasisOrder::kLinear, BasisOrder::kQuadratic}) {
    SolveOptions options;
    options.refinement = Refinement::kHierarchical;
    options.a_min = 1e-2;
    options.f_max = 0.2;
    options.basis = order;
    SolvedScene solved(scene, options);
    const auto elements = static_cast<Index>(solved.hierarchy.size());
    std::size_t leaves = 0;
    for (Index e = 0; e < elements; ++e) {
      leaves += solved.hierarchy[e].IsLeaf() ? 1U : 0U;
    }
    const Gatherer gatherer(solved.hierarchy, solved.solution.light, solved.solution.links, solved.visibility,
                            GatherOptions());
    OutputMesh mesh(solved.hierarchy, gatherer, solved.solution.links);
    TakeSolution(mesh);
    EXPECT_EQ(mesh.cut().size(), order == BasisOrder::kQuadratic ? 4 * leaves : leaves);
    double& sum = error[static_cast<std::size_t>(order)];
    for (const Index e : mesh.cut()) {
      const Vec3 x = solved.hierarchy.Shape(e).Centroid() + Vec3::Constant(1e-9);
      const Rgb known = gatherer.Irradiance(x, gatherer.SolverLeaf(e, x), e).irradiance;
      Rgb at_corners = Rgb::Zero();
      for (const Index corner : solved.hierarchy[e].corner) {
        at_corners += 0.25 * mesh.AtVertex(corner).irradiance;
      }
      sum += solved.hierarchy[e].area * (at_corners - known).square().sum();
    }
  }
  EXPECT_LT(error[1], 0.9 * error[0]);
  EXPECT_LT(error[2], 0.7 * error[1]);
}

TEST(OutputMesh, CastsRaysUntilTheirNoiseIsAsLowAsAsked) {
  const Scene scene = testing::ShadowRoom();
  GatherOptions few;
  few.rays = 4;
  few.negligible = 0.05;
  std::array<std::uint64_t, 2> rays{};
  constexpr std::array kNoise = {0.1, 0.01};
  for (std::size_t k = 0; k < kNoise.size(); ++k) {
    SolvedScene solved(scene, Quick());
    const Gatherer gatherer(solved.hierarchy, solved.solution.light, solved.solution.links, solved.visibility,
                            few);
    OutputMesh mesh(solved.hierarchy, gatherer, solved.solution.links);
    const std::uint64_t before = solved.visibility.Counted().rays;
    MeshOptions options = Fine();
    options.noise = kNoise[k];
    const MeshSummary summary = RefineMesh(mesh, options);
    rays[k] = solved.visibility.Counted().rays - before;
    EXPECT_EQ(summary.end, MeshEnd::kError);
    EXPECT_GT(summary.noise, 0);
    EXPECT_LE(summary.noise, 1.01 * kNoise[k]);
  }
  EXPECT_GT(rays[1], 4 * rays[0]);
}

TEST(OutputMesh, KeepsWhatWasGatheredWhereGatheringAnewIsStopped) {
  SolvedScene solved(testing::ShadowRoom(), Quick());
  const Gatherer gatherer(solved.hierarchy, solved.solution.light, solved.solution.links, solved.visibility,
                          GatherOptions());
  OutputMesh mesh(solved.hierarchy, gatherer, solved.solution.links);
  ASSERT_TRUE(mesh.Gather({}));
  std::map<Index, double> before;
  for (std::size_t k = 0; k < mesh.cut().size(); ++k) {
    for (const Index vertex : mesh.loops()[k]) {
      before[vertex] = mesh.AtVertex(vertex).irradiance.sum();
    }
  }
  const std::vector<Index> cut = mesh.cut();
  mesh.Divide(0);
  mesh.GatherAnew(2);
  EXPECT_FALSE(mesh.Gather([] { return true; }));
  EXPECT_EQ(mesh.cut(), cut);
  for (const auto& [vertex, irradiance] : before) {
    EXPECT_EQ(mesh.AtVertex(vertex).irradiance.sum(), irradiance);
  }
  EXPECT_TRUE(std::ranges::any_of(before, [](const auto& entry) { return entry.second > 0; }));
}

TEST(OutputMesh, ShowsAtTheFootOfAWallTheFloorThatIsThereAndNotItsElementsMean) {
  // The sun straight down on a floor, half of which lies in the shadow of a black board. A black wall gets
  // its light from the floor: at its foot half of what leaves the place below, higher up what it sees of the
  // lit half.
  constexpr double kEdge = 0.83;
  Scene scene;
  const Index grey = testing::AddMaterial(scene, 0.5, 0);
  const Index black = testing::AddMaterial(scene, 0, 0);
  testing::AddQuad(scene, grey, Vec3(0, 0, 0), Vec3(0, 0, 2), Vec3(2, 0, 2), Vec3(2, 0, 0));
  testing::AddQuad(scene, black, Vec3(0, 0, 0), Vec3(0, 1, 0), Vec3(0, 1, 2), Vec3(0, 0, 2));
  testing::AddQuad(scene, black, Vec3(-1, 1.5, -1), Vec3(-1, 1.5, kEdge), Vec3(2, 1.5, kEdge),
                   Vec3(2, 1.5, -1));
  PunctualLight sun;
  sun.kind = PunctualLight::Kind::kDirectional;
  sun.direction = -Vec3::UnitY();
  sun.intensity = Rgb::Constant(1);
  scene.lights.push_back(sun);
  SolveOptions coarse = Quick();
  coarse.w_min = 1e-2;
  SolvedScene solved(scene, coarse);
  const BakedMesh wall = solved.Output(Fine()).surfaces[1].front;
  const Polygon lit{{Vec3(0, 0, kEdge), Vec3(0, 0, 2), Vec3(2, 0, 2), Vec3(2, 0, kEdge)}, 4, Vec3::UnitY()};
  int at_foot = 0;
  int near_foot = 0;
  for (const BakedVertex& vertex : wall.vertices) {
    const auto [x, y, z] = PlaceOf(scene.surfaces[1], vertex);
    if (y > 0 && y < 0.3 && z > 0 && z < 2) {
      ++near_foot;
      const double seen = PointToPolygon(Vec3(x, y, z), Vec3::UnitX(), lit, 0);
      // Two points of a floor that is black or bright.
      EXPECT_NEAR(vertex.irradiance.maxCoeff(), 0.5 * seen, 0.04) << "at " << y << ", " << z;
    }
    if (y == 0 && z > 0 && z < 2) {
      ++at_foot;
      EXPECT_NEAR(vertex.irradiance.maxCoeff(), z > kEdge ? 0.25 : 0, 0.02) << "at " << z;
    }
  }
  EXPECT_GT(at_foot, 5);
  EXPECT_GT(near_foot, 20);
}

TEST(OutputMesh, LightsBothSidesOfADoubleSidedSurfaceEachForItself) {
  Scene scene = testing::ShadowRoom();
  scene.surfaces.resize(7);  // no slab
  const Index both = testing::AddMaterial(scene, 0.5, 0);
  scene.materials[both].sides = Sides::kBoth;
  testing::AddQuad(scene, both, Vec3(0.5, 1, 0.5), Vec3(0.5, 1, 1.5), Vec3(1.5, 1, 1.5),
                   Vec3(1.5, 1, 0.5));  // up
  SolvedScene solved(scene, Quick());
  const BakedSurface sheet = solved.Output(Fine()).surfaces.back();
  ASSERT_FALSE(sheet.front.triangles.empty());
  ASSERT_FALSE(sheet.back.triangles.empty());
  const auto brightest = [](const BakedMesh& mesh) {
    float most = 0;
    for (const BakedVertex& vertex : mesh.vertices) {
      most = std::max(most, vertex.irradiance.maxCoeff());
    }
    return most;
  };
  EXPECT_GT(brightest(sheet.front), 2 * brightest(sheet.back));
  EXPECT_GT(brightest(sheet.back), 0);
}

}  // namespace
}  // namespace radbake
