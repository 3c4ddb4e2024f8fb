/// What stands close to a surface.
#pragma once

#include "solver/hierarchy/hierarchy.h"

namespace radbake {

/// Is any part of another patch in front of the element, nearer to its middle than 1.5 times its radius? Its
/// shadow may be smaller than the element, and fall between the points where that is looked at. Of a
/// hierarchy with clusters; without, false.
bool StandsSomethingOn(const Hierarchy& hierarchy, Index element);

}  // namespace radbake
