#include "solver/transport/punctual.h"

#include <algorithm>

namespace radbake {

double PunctualKernel(const PunctualLight& light, const Vec3& x, const Vec3& n) {
  if (light.kind == PunctualLight::Kind::kDirectional) {
    return std::max(0.0, -n.dot(light.direction));
  }
  const Vec3 along = x - light.position;
  const double d2 = along.squaredNorm();
  const double facing = -n.dot(along);
  return facing > 0 ? facing / (d2 * std::sqrt(d2)) * light.Attenuation(along) : 0;
}

Vec3 ShadowRayEnd(const PunctualLight& light, const Vec3& x) {
  constexpr double kBeyond = 4;
  return light.kind == PunctualLight::Kind::kDirectional ? Vec3(x - kBeyond * light.direction)
                                                         : light.position;
}

}  // namespace radbake
