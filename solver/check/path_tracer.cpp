#include "solver/check/path_tracer.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "solver/check/sample_points.h"

namespace radbake {
namespace {

// Paths are ended at random once they carry less than this. Ending by reflectance alone saves rays, but where
// nearly all light is reflected it makes most of the variance.
constexpr double kRouletteBelow = 0.25;

Vec3 CosineDirection(const Vec3& normal, std::array<double, 2> sample) {
  const double radius = std::sqrt(sample[0]);
  const double angle = 2 * std::numbers::pi * sample[1];
  // Duff et al.: Building an orthonormal basis, revisited, 2017.
  const double sign = std::copysign(1.0, normal.z());
  const double a = -1 / (sign + normal.z());
  const double b = normal.x() * normal.y() * a;
  const Vec3 tangent(1 + sign * normal.x() * normal.x() * a, sign * b, -sign * normal.x());
  const Vec3 bitangent(b, sign + normal.y() * normal.y() * a, -normal.y());
  return radius * std::cos(angle) * tangent + radius * std::sin(angle) * bitangent +
         std::sqrt(1 - sample[0]) * normal;
}

// E = ∫ L·cos·cos'/r² dA; by direction the same point has the density cos/π·cos'/r².
double FormFactor(double receiving, double emitting, double distance) {
  return receiving * emitting / (distance * distance) / std::numbers::pi;
}

}  // namespace

std::vector<LightTree::Lamp> PathTracer::Lamps(const TracedScene& scene) {
  std::vector<LightTree::Lamp> lamps;
  for (Index i = 0; i < scene.facets.size(); ++i) {
    const Facet& facet = scene.facets[i];
    if (facet.area > 0 && (facet.emission > 0).any()) {
      const auto& [a, b, c] = scene.corners[i];
      const Vec3 centre = (a + b + c) / 3;
      lamps.push_back({.centre = centre,
                       .radius = std::sqrt(std::max({(a - centre).squaredNorm(), (b - centre).squaredNorm(),
                                                     (c - centre).squaredNorm()})),
                       .weight = facet.area * facet.emission.sum(),
                       .axis = facet.normal,
                       .cosine = facet.back ? -1.0 : 0.0});
    }
  }
  for (const PunctualLight& light : scene.lights) {
    if (light.kind != PunctualLight::Kind::kDirectional) {
      lamps.push_back({.centre = light.position,
                       .radius = 0,
                       .weight = light.intensity.sum(),
                       .axis = light.direction,
                       .cosine = light.kind == PunctualLight::Kind::kSpot ? light.outer_cosine : -1.0});
    }
  }
  return lamps;
}

Overlaps PathTracer::OverlapsOf(const TracedScene& scene) {
  std::vector<Polygon> faces(2 * scene.facets.size());
  std::vector<double> emission(faces.size());
  for (Index i = 0; i < scene.facets.size(); ++i) {
    const Facet& facet = scene.facets[i];
    for (const bool front : {true, false}) {
      if (front ? facet.front : facet.back) {
        Polygon& face = faces[Face(i, front)];
        face.count = 3;
        face.normal = front ? facet.normal : Vec3(-facet.normal);
        emission[Face(i, front)] = Luminance(facet.emission);
        std::ranges::copy(scene.corners[i], face.corner.begin());
        if (!front) {
          std::swap(face[1], face[2]);
        }
      }
    }
  }
  return {faces, emission, RayCaster::kPlaneTolerance};
}

PathTracer::PathTracer(const TracedScene& scene)
    : scene_(scene),
      caster_(scene.corners),
      overlaps_(OverlapsOf(scene)),
      sky_(scene, caster_),
      lamp_(scene.facets.size(), kNone),
      lamps_(Lamps(scene)) {
  for (Index i = 0; i < scene.facets.size(); ++i) {
    if (scene.facets[i].area > 0 && (scene.facets[i].emission > 0).any()) {
      lamp_[i] = static_cast<Index>(emitters_.size());
      emitters_.push_back(i);
    }
  }
  double power = 0;
  for (Index i = 0; i < scene.lights.size(); ++i) {
    if (scene.lights[i].kind == PunctualLight::Kind::kDirectional) {
      power += scene.lights[i].intensity.sum();
      suns_.push_back(i);
      cumulative_.push_back(power);
    } else {
      points_.push_back(i);
    }
  }
  for (double& sum : cumulative_) {
    sum /= power;
  }
}

Rgb PathTracer::FromSource(const Place& place, const Source& source, std::size_t& rays) const {
  const Vec3 way = source.point - place.point;
  const double distance = way.norm();
  const double receiving = place.normal.dot(way);
  const double facing = -source.normal.dot(way);
  const double emitting = source.back ? std::abs(facing) : facing;
  if (receiving <= 0 || emitting <= 0) {
    return Rgb::Zero();
  }
  const Index face = source.facet == kNone ? kNone : Face(source.facet, facing > 0);
  if (face != kNone && overlaps_.At(face, source.point) != face) {
    return Rgb::Zero();
  }
  ++rays;
  if (caster_.Occluded(place.point, source.point)) {
    return Rgb::Zero();
  }
  const double form_factor = FormFactor(receiving / distance, emitting / distance, distance);
  return source.emission * (form_factor / (source.density + form_factor));
}

Rgb PathTracer::FromPoint(const Place& place, const PunctualLight& light, std::size_t& rays) const {
  const Vec3 way = light.position - place.point;
  const double receiving = place.normal.dot(way);
  const double share = receiving > 0 ? light.Attenuation(-way) : 0;
  if (share <= 0) {
    return Rgb::Zero();
  }
  ++rays;
  if (caster_.Occluded(place.point, light.position)) {
    return Rgb::Zero();
  }
  const double distance = way.norm();
  return light.intensity * (share * receiving / (distance * distance * distance) / std::numbers::pi);
}

Rgb PathTracer::FromLamps(const Place& place, std::array<double, 2> sample, std::size_t& rays) const {
  const std::optional<LightTree::Choice> choice = lamps_.Choose(place, sample[0]);
  if (!choice) {
    return Rgb::Zero();
  }
  if (choice->lamp >= emitters_.size()) {
    const PunctualLight& light = scene_.lights[points_[choice->lamp - emitters_.size()]];
    return FromPoint(place, light, rays) / choice->probability;
  }
  const Index emitter = emitters_[choice->lamp];
  const Facet& facet = scene_.facets[emitter];
  return FromSource(place,
                    {.point = PointOf(scene_.corners[emitter], {choice->rest, sample[1]}),
                     .normal = facet.normal,
                     .back = facet.back,
                     .emission = facet.emission,
                     .density = choice->probability / facet.area,
                     .facet = emitter},
                    rays);
}

Rgb PathTracer::FromSky(const Place& place, std::array<double, 2> sample, std::size_t& rays) const {
  const std::optional<Sky::Point> point = sky_.Draw(place, sample);
  if (!point) {
    return Rgb::Zero();
  }
  return FromSource(place,
                    {.point = point->point,
                     .normal = point->normal,
                     .back = false,
                     .emission = scene_.environment,
                     .density = point->density,
                     .facet = kNone},
                    rays);
}

Rgb PathTracer::FromSuns(const Place& place, double sample, std::size_t& rays) const {
  if (suns_.empty()) {
    return Rgb::Zero();
  }
  const auto chosen = std::ranges::upper_bound(cumulative_.begin(), cumulative_.end() - 1, sample);
  const double before = chosen == cumulative_.begin() ? 0 : *std::prev(chosen);
  const PunctualLight& sun = scene_.lights[suns_[static_cast<std::size_t>(chosen - cumulative_.begin())]];
  const double receiving = -place.normal.dot(sun.direction);
  if (receiving <= 0) {
    return Rgb::Zero();
  }
  ++rays;
  constexpr double kOutside = 4;  // of a scene of unit size
  if (caster_.Occluded(place.point, place.point - kOutside * sun.direction)) {
    return Rgb::Zero();
  }
  return sun.intensity * (receiving / (*chosen - before) / std::numbers::pi);
}

double PathTracer::DeadShare(const Place& place) const {
  constexpr std::uint32_t kRays = 16;
  const SamplePoints points(0);
  std::uint32_t dead = 0;
  for (std::uint32_t i = 0; i < kRays; ++i) {
    const auto hit = caster_.Closest(place.point, CosineDirection(place.normal, points.Point(i, 0)));
    if (hit && !(hit->front ? scene_.facets[hit->triangle].front : scene_.facets[hit->triangle].back)) {
      ++dead;
    }
  }
  return static_cast<double>(dead) / kRays;
}

PathTracer::Estimate PathTracer::Irradiance(const Place& place, std::uint32_t paths,
                                            std::uint64_t stream) const {
  const SamplePoints points(stream);
  Estimate estimate;
  for (std::uint32_t path = 0; path < paths; ++path) {
    Place at = place;
    Rgb throughput = Rgb::Ones();
    for (std::uint32_t dimension = 0;; dimension += 4) {
      const std::array<double, 2> spare = points.Point(path, dimension + 2);
      const Rgb direct = FromLamps(at, points.Point(path, dimension), estimate.rays) +
                         FromSky(at, points.Point(path, dimension + 3), estimate.rays) +
                         FromSuns(at, spare[1], estimate.rays);
      estimate.irradiance += throughput * direct;
      const Vec3 direction = CosineDirection(at.normal, points.Point(path, dimension + 1));
      const auto hit = caster_.Closest(at.point, direction);
      ++estimate.rays;
      if (!hit) {
        const Sky::Point exit = sky_.Exit(at, direction);
        const double form_factor =
            FormFactor(at.normal.dot(direction), -exit.normal.dot(direction), (exit.point - at.point).norm());
        estimate.irradiance += throughput * scene_.environment * (form_factor / (form_factor + exit.density));
        break;
      }
      // Of several facets in one place the ray may meet any; one of them is there.
      const Vec3 point = at.point + hit->distance * direction;
      const Index face = overlaps_.At(Face(hit->triangle, hit->front), point);
      const Index met = face / 2;
      const Facet& facet = scene_.facets[met];
      const bool front = face == Face(met, true);
      if (!(front ? facet.front : facet.back)) {
        break;
      }
      const Place next{.point = point, .normal = front ? facet.normal : Vec3(-facet.normal)};
      if (const Index lamp = lamp_[met]; lamp != kNone) {
        const double density = lamps_.Probability(lamp, at) / facet.area;
        const double form_factor =
            FormFactor(at.normal.dot(direction), -next.normal.dot(direction), hit->distance);
        estimate.irradiance += throughput * facet.emission * (form_factor / (form_factor + density));
      }
      throughput *= facet.reflectance;
      const double survival = throughput.maxCoeff() / kRouletteBelow;
      if (survival < 1) {
        if (spare[0] >= survival) {
          break;
        }
        throughput /= survival;
      }
      at = next;
    }
  }
  estimate.irradiance /= paths;
  return estimate;
}

}  // namespace radbake
