// What holds of every closed room: random convex prisms, each wall with a reflectance and an emission of its
// own.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>
#include <vector>

#include "solver/solve/rows.h"
#include "tests/solve/solved_scene_test.h"
#include "tests/test_scenes.h"

namespace radbake {
namespace {

using testing::SolvedScene;

/// What RapidCheck draws, and shrinks where something fails: small numbers, in fixed steps.
struct Room {
  std::vector<int> gaps;          // between the corners of the floor, as parts of the circle around it
  int height = 10;                // tenths of the circle's radius
  int squeeze = 10;               // of the circle to an ellipse, in tenths
  std::vector<int> reflectances;  // floor, ceiling, walls: percent
  std::vector<int> emissions;     // cd/m²

  std::size_t sides() const { return gaps.size() + 2; }
};

void showValue(const Room& room, std::ostream& out) {
  out << "gaps " << ::testing::PrintToString(room.gaps) << ", height " << room.height << ", squeeze "
      << room.squeeze << ", reflectances " << ::testing::PrintToString(room.reflectances) << ", emissions "
      << ::testing::PrintToString(room.emissions);
}

Room DrawRoom() {
  Room room;
  const auto walls = static_cast<std::size_t>(*rc::gen::inRange(3, 7));
  // No gap is half of all: the middle lies inside.
  room.gaps = *rc::gen::suchThat(rc::gen::container<std::vector<int>>(walls, rc::gen::inRange(2, 10)),
                                 [](const auto& gaps) {
                                   int sum = 0;
                                   for (const int gap : gaps) {
                                     sum += gap;
                                   }
                                   return 2 * *std::max_element(gaps.begin(), gaps.end()) < sum;
                                 });
  room.height = *rc::gen::inRange(3, 40);
  room.squeeze = *rc::gen::inRange(4, 11);
  room.reflectances = *rc::gen::container<std::vector<int>>(room.sides(), rc::gen::inRange(0, 96));
  room.emissions = *rc::gen::container<std::vector<int>>(room.sides(), rc::gen::inRange(0, 10));
  room.emissions[0] += 1;  // some light there must be
  return room;
}

Room AnyRoom() {
  return *rc::gen::exec(DrawRoom);
}

/// One surface a side; fronts inwards.
Scene Built(const Room& room) {
  int parts = 0;
  for (const int gap : room.gaps) {
    parts += gap;
  }
  std::vector<Vec3> low;
  int at = 0;
  for (const int gap : room.gaps) {
    const double angle = 2 * std::numbers::pi * at / parts;
    low.emplace_back(std::cos(angle), room.squeeze / 10.0 * std::sin(angle), 0);
    at += gap;
  }
  const Vec3 up(0, 0, room.height / 10.0);
  Scene scene;
  const auto add = [&](const std::vector<Vec3>& corners) {
    const std::size_t side = scene.surfaces.size();
    Surface surface;
    surface.name = "side " + std::to_string(side);
    surface.material = testing::AddMaterial(scene, room.reflectances[side] / 100.0,
                                            static_cast<double>(room.emissions[side]));
    surface.positions = corners;
    for (Index i = 1; i + 1 < corners.size(); ++i) {
      surface.triangles.push_back({0, i, i + 1});
    }
    scene.surfaces.push_back(surface);
  };
  add(low);
  std::vector<Vec3> high;
  for (std::size_t i = low.size(); i-- > 0;) {
    high.emplace_back(low[i] + up);
  }
  add(high);
  for (std::size_t i = 0; i < low.size(); ++i) {
    const Vec3& a = low[i];
    const Vec3& b = low[(i + 1) % low.size()];
    add({b, a, a + up, b + up});
  }
  return scene;
}

SolveOptions Static() {
  SolveOptions options;
  options.refinement = Refinement::kHierarchical;
  options.a_min = 5e-3;
  options.f_max = 0.2;
  options.tolerance = 1e-9;
  return options;
}

/// Fine enough that a link more or less, where rounding decides, is of no account.
SolveOptions Fine() {
  SolveOptions options = Static();
  options.a_min = 2e-3;
  options.f_max = 0.1;
  return options;
}

/// The mean irradiance of each surface in lx.
std::vector<double> MeanIrradiance(const Scene& scene, const SolveOptions& options = Static()) {
  const SolvedScene solved(scene, options);
  std::vector<double> flux(scene.surfaces.size());
  std::vector<double> area(scene.surfaces.size());
  for (Index p = 0; p < solved.patches.surface_patches; ++p) {
    const Patch& patch = solved.patches.patches[p];
    flux[patch.surface] +=
        patch.area * solved.solution.light.irradiance[p][0] * solved.patches.normalization.radiance;
    area[patch.surface] += patch.area;
  }
  for (std::size_t s = 0; s < flux.size(); ++s) {
    flux[s] /= area[s];
  }
  return flux;
}

void AssertNear(const std::vector<double>& a, const std::vector<double>& b, double tolerance) {
  RC_ASSERT(a.size() == b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (!(std::abs(a[i] - b[i]) <= tolerance * std::abs(a[i]))) {
      RC_LOG() << "side " << i << ": " << a[i] << " and " << b[i];
      RC_FAIL("not the same light");
    }
  }
}

Scene Moved(Scene scene, const Eigen::Affine3d& move) {
  for (Surface& surface : scene.surfaces) {
    for (Vec3& position : surface.positions) {
      position = move * position;
    }
  }
  return scene;
}

RC_GTEST_PROP(ClosedRooms, HaveRowsThatSumToOne, ()) {
  const SolvedScene solved(Built(AnyRoom()), Static());
  const Rows rows(solved.hierarchy, solved.solution.links, solved.solution.light);
  for (std::size_t k = 0; k < rows.leaves().size(); ++k) {
    double sum = 0;
    for (const Gathered& entry : rows[k]) {
      sum += static_cast<double>(entry.weight);
    }
    RC_LOG() << "row " << k << ": " << sum;
    RC_ASSERT(std::abs(sum - 1) < 1e-3);
  }
}

RC_GTEST_PROP(ClosedRooms, HaveReciprocalLinks, ()) {
  const SolvedScene solved(Built(AnyRoom()), Static());
  std::map<std::pair<Index, Index>, double> exchange;
  std::size_t pairs = 0;
  for (const Link& link : solved.solution.links.all()) {
    const double there = solved.hierarchy[link.receiver].area * static_cast<double>(link.form_factor);
    const auto back = exchange.find({link.shooter, link.receiver});
    if (back == exchange.end()) {
      exchange[{link.receiver, link.shooter}] = there;
    } else {
      ++pairs;
      RC_ASSERT(std::abs(there - back->second) <= 1e-6 * there);
    }
  }
  RC_ASSERT(pairs > 0U);
}

void AssertAbsorbsWhatIsEmitted(const Scene& scene, BasisOrder order) {
  SolveOptions options;
  options.basis = order;
  options.a_min = 1e-3;
  options.w_min = 2e-4;
  const std::vector<double> irradiance = MeanIrradiance(scene, options);
  double emitted = 0;
  double absorbed = 0;
  for (std::size_t s = 0; s < scene.surfaces.size(); ++s) {
    const Surface& surface = scene.surfaces[s];
    const Material& material = scene.materials[surface.material];
    double area = 0;
    for (const Triangle& t : surface.triangles) {
      area += (surface.positions[t[1]] - surface.positions[t[0]])
                  .cross(surface.positions[t[2]] - surface.positions[t[0]])
                  .norm() /
              2;
    }
    emitted += area * std::numbers::pi * material.emission[0];
    absorbed += area * (1 - material.reflectance[0]) * irradiance[s];
  }
  RC_LOG() << emitted << " lm emitted, " << absorbed << " lm absorbed";
  RC_ASSERT(std::abs(absorbed / emitted - 1) < 5e-3);
}

RC_GTEST_PROP(ClosedRooms, AbsorbWhatIsEmitted, ()) {
  AssertAbsorbsWhatIsEmitted(Built(AnyRoom()), BasisOrder::kConstant);
}

RC_GTEST_PROP(ClosedRooms, AbsorbWhatIsEmittedInHigherBases, ()) {
  const Scene scene = Built(AnyRoom());
  AssertAbsorbsWhatIsEmitted(scene, BasisOrder::kLinear);
  AssertAbsorbsWhatIsEmitted(scene, BasisOrder::kQuadratic);
}

RC_GTEST_PROP(ClosedRooms, AddTheirLightsUp, ()) {
  Room both = AnyRoom();
  both.emissions[0] += 1;  // the floor shines in either room
  Room first = both;
  Room second = both;
  for (std::size_t i = 1; i < both.sides(); ++i) {
    (i % 2 == 0 ? first : second).emissions[i] = 0;
  }
  second.emissions[0] = both.emissions[0] - 1;
  first.emissions[0] = 1;
  std::vector<double> sum = MeanIrradiance(Built(first));
  const std::vector<double> of_second = MeanIrradiance(Built(second));
  for (std::size_t s = 0; s < sum.size(); ++s) {
    sum[s] += of_second[s];
  }
  AssertNear(MeanIrradiance(Built(both)), sum, 1e-5);
}

RC_GTEST_PROP(ClosedRooms, AreTheSameHoweverTheyAreTurnedAndWherever, ()) {
  const Scene scene = Built(AnyRoom());
  const auto number = [] { return *rc::gen::inRange(-100, 101); };
  Eigen::Quaterniond turn(number() + 0.5, number(), number(), number());
  turn.normalize();
  const Eigen::Affine3d move = Eigen::Translation3d(number(), number(), number()) * turn;
  AssertNear(MeanIrradiance(scene, Fine()), MeanIrradiance(Moved(scene, move), Fine()), 2e-3);
}

RC_GTEST_PROP(ClosedRooms, AreTheSameInAnyOrder, ()) {
  const Scene scene = Built(AnyRoom());
  const std::vector<double> expected = MeanIrradiance(scene, Fine());
  std::vector<std::size_t> order(scene.surfaces.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    order[i] = i;
  }
  for (std::size_t i = order.size(); i-- > 1;) {
    std::swap(order[i], order[static_cast<std::size_t>(*rc::gen::inRange(0, static_cast<int>(i) + 1))]);
  }
  Scene shuffled = scene;
  std::vector<double> in_order;
  for (std::size_t i = 0; i < order.size(); ++i) {
    shuffled.surfaces[i] = scene.surfaces[order[i]];
    in_order.push_back(expected[order[i]]);
    // A triangle may begin at any of its corners.
    for (Triangle& triangle : shuffled.surfaces[i].triangles) {
      std::rotate(triangle.begin(), triangle.begin() + *rc::gen::inRange(0, 3), triangle.end());
    }
  }
  AssertNear(in_order, MeanIrradiance(shuffled, Fine()), 2e-3);
}

}  // namespace
}  // namespace radbake
