#include "solver/refine/oracle.h"

namespace radbake {

double ComparableArea(const Hierarchy& hierarchy, Index node) {
  const double area = hierarchy.Area(node);
  return IsElement(node) && hierarchy.IsSky(node) ? area / (kSkyDistance * kSkyDistance) : area;
}

bool IsDivisible(const Hierarchy& hierarchy, Index node, double largest_area) {
  return IsCluster(node) || (IsElement(node) && ComparableArea(hierarchy, node) > largest_area);
}

bool IsAtLeast(double a, double b) {
  constexpr double kRounding = 1e-4;
  return a >= (1 - kRounding) * b;
}

}  // namespace radbake
