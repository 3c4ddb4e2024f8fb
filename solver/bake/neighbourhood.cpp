#include "solver/bake/neighbourhood.h"

namespace radbake {
namespace {

constexpr double kNear = 1.5;  // radii

class Search {
 public:
  Search(const Hierarchy& hierarchy, Index element)
      : hierarchy_(hierarchy),
        patch_(hierarchy[element].patch),
        plane_(PlaneOf(hierarchy.Shape(element))),
        centre_(hierarchy.Centre(element)),
        reach_(kNear * hierarchy.Radius(element)) {}

  bool Finds(Index node) const {
    if (IsCluster(node)) {
      const Cluster& cluster = hierarchy_.clusters()[node - kFirstCluster];
      if ((cluster.centre - centre_).norm() > reach_ + cluster.radius ||
          plane_.Distance(cluster.centre) + cluster.radius <= hierarchy_.patches().weld) {
        return false;
      }
      for (const Index child : hierarchy_.clusters().Children(node - kFirstCluster)) {
        if (Finds(child)) {
          return true;
        }
      }
      return false;
    }
    const Polygon shape = hierarchy_.Shape(node);
    return node != patch_ &&
           ClipToFront(shape, {plane_.normal, plane_.offset + hierarchy_.patches().weld}).count > 0 &&
           (NearestPoint(shape, centre_) - centre_).norm() < reach_;
  }

 private:
  const Hierarchy& hierarchy_;
  Index patch_;
  Plane plane_;
  Vec3 centre_;
  double reach_;
};

}  // namespace

bool StandsSomethingOn(const Hierarchy& hierarchy, Index element) {
  return !hierarchy.clusters().empty() && Search(hierarchy, element).Finds(ClusterNode(0));
}

}  // namespace radbake
