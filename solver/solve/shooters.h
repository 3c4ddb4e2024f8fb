/// What all nodes shoot in one application of the operator.
#pragma once

#include <vector>

#include "solver/hierarchy/nodes.h"
#include "solver/scene/types.h"

namespace radbake {

struct Shooters {
  std::vector<Rgb> elements;      ///< radiosity of the open part
  std::vector<Rgb> coefficients;  ///< K > 1: its polynomial
  std::vector<Rgb> clusters;      ///< by link, of those from clusters
  std::vector<Rgb> punctual;      ///< intensities

  /// `gathered`: as GatheredFrom() names it.
  const Rgb& Of(Index gathered) const {
    if (IsElement(gathered)) {
      return elements[gathered];
    }
    return IsPunctual(gathered) ? punctual[gathered - kFirstPunctual] : clusters[gathered - kFirstCluster];
  }
};

}  // namespace radbake
