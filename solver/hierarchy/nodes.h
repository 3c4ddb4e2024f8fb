/// The nodes that a link can join: elements, clusters above patches, and lights without area.
#pragma once

#include "solver/scene/types.h"

namespace radbake {

/// A node is an element's index, or a cluster's above kFirstCluster, or a punctual light's above
/// kFirstPunctual.
inline constexpr Index kFirstCluster = 0x8000'0000U;
inline constexpr Index kFirstPunctual = 0xC000'0000U;

inline bool IsElement(Index node) {
  return node < kFirstCluster;
}
inline bool IsCluster(Index node) {
  return node >= kFirstCluster && node < kFirstPunctual;
}
inline bool IsPunctual(Index node) {
  return node >= kFirstPunctual && node != kNone;
}
inline Index ClusterNode(Index cluster) {
  return kFirstCluster + cluster;
}
inline Index PunctualNode(Index light) {
  return kFirstPunctual + light;
}

}  // namespace radbake
