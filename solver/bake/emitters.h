/// The light at a point that comes straight from the patches that emit.
#pragma once

#include <vector>

#include "solver/bake/estimate.h"
#include "solver/hierarchy/hierarchy.h"
#include "solver/transport/visibility.h"

namespace radbake {

/// A few emitters are each looked at, their form factors exact, by rays in proportion to what they give. Of
/// many, as in the meshes of lamps, the rays choose some: down the tree of clusters, at each node by power
/// over squared distance (Estevez and Kulla, Importance sampling of many lights with adaptive tree splitting,
/// 2018). Immutable; thread-safe.
class Emitters {
 public:
  /// Of a hierarchy with clusters, which must outlive it.
  explicit Emitters(const Hierarchy& hierarchy);

  /// At `x` with unit normal `n`, by about `rays` rays for a light of the luminous irradiance `scale`, and at
  /// least one.
  Estimate At(const Visibility& visibility, const Vec3& x, const Vec3& n, double scale, double rays,
              std::uint64_t key) const;

 private:
  struct Node {
    Vec3 centre = Vec3::Zero();
    double radius = 0;
    double power = 0;     // luminous
    Index patch = kNone;  // of a leaf
    Index begin = 0;      // children, of any other
    Index end = 0;
  };
  Node Leaf(Index patch) const;
  Estimate FromEach(const Visibility& visibility, const Vec3& x, const Vec3& n, double scale, double rays,
                    std::uint64_t key) const;
  Estimate FromSome(const Visibility& visibility, const Vec3& x, const Vec3& n, double rays,
                    std::uint64_t key) const;
  /// What a ray is worth that is sent to the node: not 0 if any of it is in front.
  static double Importance(const Node& node, const Vec3& x, const Vec3& n);

  const Hierarchy& hierarchy_;
  std::vector<Node> nodes_;     // the root first; siblings in a row
  std::vector<Index> patches_;  // that emit
};

}  // namespace radbake
