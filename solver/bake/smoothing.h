/// Takes the rays' noise out of what was gathered.
#pragma once

#include "solver/bake/output_mesh.h"

namespace radbake {

/// Where the irradiance around a vertex or a centre, on its own smooth or flat surface, differs from a smooth
/// function by no more than its rays' variance explains, it takes that function's value (local regression);
/// where it differs by more, it keeps so much of its own as the variance does not explain (Lee, Digital Image
/// Enhancement and Noise Filtering by Use of Local Statistics, IEEE PAMI 2(2), 1980). So an edge that stands
/// out of the noise stays, and nothing moves farther than the noise reaches. Variances become those that are
/// left. Before OutputMesh::CoverSealed. The same on any number of threads.
void SmoothNoise(OutputMesh& mesh);

}  // namespace radbake
