#include "solver/hierarchy/light.h"

namespace radbake {

void Light::Extend(const Hierarchy& hierarchy) {
  radiosity.reserve(hierarchy.size());
  for (auto e = static_cast<Index>(radiosity.size()); e < hierarchy.size(); ++e) {
    const Index parent = hierarchy[e].parent;
    radiosity.push_back(parent == kNone ? hierarchy.PatchOf(e).emission : radiosity[parent]);
  }
  irradiance.resize(hierarchy.size(), Rgb::Zero());
  variation.resize(hierarchy.size(), 0.0);
  open.resize(hierarchy.size(), 1.0);
}

}  // namespace radbake
