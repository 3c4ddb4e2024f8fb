/// What rays say of the irradiance at a point.
#pragma once

#include "solver/scene/types.h"

namespace radbake {

struct Estimate {
  Rgb irradiance = Rgb::Zero();  ///< normalised
  double variance = 0;           ///< of all channels, as the rays themselves tell

  Estimate& operator+=(const Estimate& other) {
    irradiance += other.irradiance;
    variance += other.variance;
    return *this;
  }
};

}  // namespace radbake
