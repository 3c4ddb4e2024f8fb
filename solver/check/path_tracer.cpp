#include "solver/check/path_tracer.h"

#include <algorithm>
#include <cmath>
#include <numbers>

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

double Power(const Facet& facet) {
  return facet.area * facet.emission.sum() * (facet.back ? 2 : 1);
}

}  // namespace

PathTracer::PathTracer(const TracedScene& scene)
    : scene_(scene), caster_(scene.corners), light_density_(scene.facets.size()) {
  double total = 0;
  for (const Facet& facet : scene.facets) {
    total += Power(facet);
  }
  double cumulative = 0;
  for (Index i = 0; i < scene.facets.size(); ++i) {
    if (const double power = Power(scene.facets[i]); power > 0) {
      cumulative += power / total;
      lights_.push_back({.facet = i, .cumulative = cumulative});
      light_density_[i] = power / total / scene.facets[i].area;
    }
  }
}

Rgb PathTracer::FromLights(const Place& place, std::array<double, 2> sample, std::size_t& rays) const {
  if (lights_.empty()) {
    return Rgb::Zero();
  }
  const auto chosen =
      std::ranges::upper_bound(lights_.begin(), lights_.end() - 1, sample[0], {}, &Light::cumulative);
  const double before = chosen == lights_.begin() ? 0 : std::prev(chosen)->cumulative;
  const double u = std::clamp((sample[0] - before) / (chosen->cumulative - before), 0.0, 1.0);
  const Facet& light = scene_.facets[chosen->facet];
  const Vec3 point = PointOf(scene_.corners[chosen->facet], {u, sample[1]});
  const Vec3 way = point - place.point;
  const double squared_distance = way.squaredNorm();
  const double receiving = place.normal.dot(way);
  const double facing = -light.normal.dot(way);
  const double emitting = light.back ? std::abs(facing) : facing;
  if (receiving <= 0 || emitting <= 0) {
    return Rgb::Zero();
  }
  ++rays;
  if (caster_.Occluded(place.point, point)) {
    return Rgb::Zero();
  }
  // E = ∫ L·cos·cos'/r² dA; by direction the same point has the density cos/π·cos'/r².
  const double form_factor = receiving * emitting / (squared_distance * squared_distance) / std::numbers::pi;
  return light.emission * (form_factor / (light_density_[chosen->facet] + form_factor));
}

PathTracer::Estimate PathTracer::Irradiance(const Place& place, std::uint32_t paths,
                                            std::uint64_t stream) const {
  const SamplePoints points(stream);
  Estimate estimate;
  for (std::uint32_t path = 0; path < paths; ++path) {
    Place at = place;
    Rgb throughput = Rgb::Ones();
    for (std::uint32_t dimension = 0;; dimension += 3) {
      estimate.irradiance += throughput * FromLights(at, points.Point(path, dimension), estimate.rays);
      const Vec3 direction = CosineDirection(at.normal, points.Point(path, dimension + 1));
      const auto hit = caster_.Closest(at.point, direction);
      ++estimate.rays;
      if (!hit) {
        break;
      }
      const Facet& facet = scene_.facets[hit->triangle];
      if (!(hit->front ? facet.front : facet.back)) {
        break;
      }
      const Place next{.point = at.point + hit->distance * direction,
                       .normal = hit->front ? facet.normal : Vec3(-facet.normal)};
      if (const double density = light_density_[hit->triangle]; density > 0) {
        const double form_factor = at.normal.dot(direction) * -next.normal.dot(direction) /
                                   (hit->distance * hit->distance) / std::numbers::pi;
        estimate.irradiance += throughput * facet.emission * (form_factor / (form_factor + density));
      }
      throughput *= facet.reflectance;
      const double survival = throughput.maxCoeff() / kRouletteBelow;
      if (survival < 1) {
        if (points.Point(path, dimension + 2)[0] >= survival) {
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
