#include "solver/scene/scene.h"

#include <algorithm>
#include <cmath>

namespace radbake {

double PunctualLight::Attenuation(const Vec3& along) const {
  if (kind == Kind::kDirectional) {
    return 1;
  }
  const double distance = along.norm();
  double share = 1;
  if (kind == Kind::kSpot) {
    // The extension's reference code: the square of a linear fall between the cosines of the two cones.
    constexpr double kNarrowest = 1e-3;
    const double cosine = direction.dot(along) / distance;
    const double fall = (cosine - outer_cosine) / std::max(kNarrowest, inner_cosine - outer_cosine);
    share = std::pow(std::clamp(fall, 0.0, 1.0), 2);
  }
  if (std::isfinite(range)) {
    share *= std::clamp(1 - std::pow(distance / range, 4), 0.0, 1.0);
  }
  return share;
}

}  // namespace radbake
