/// Zones: surfaces that exchange light, directly or over others.
#pragma once

#include <vector>

#include "solver/scene/patches.h"
#include "solver/transport/visibility.h"

namespace radbake {

/// A zone for each of the surfaces' patches: two are in one zone if rays lead from one to the other, on their
/// own or over further patches; under a sky, all that see it are in one. Zones are numbered by size from 0
/// on, the largest first. What rays missed lies in several zones though light may go between them: a hint for
/// how to group patches, no proof.
std::vector<Index> FindZones(const Patches& patches, const Visibility& visibility);

}  // namespace radbake
