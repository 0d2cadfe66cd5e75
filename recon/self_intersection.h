// Where a surface goes through itself.
#pragma once

#include <cstdint>

#include "base/mesh.h"

namespace v3d {

/// The number of pairs of triangles that cross although they share no vertex: an edge of one goes
/// through the inside of the other. Triangles that only touch, or lie in one plane, do not count.
/// Exact up to the rounding of double precision; the same for any number of threads.
int64_t count_self_intersections(const Mesh& mesh);

}  // namespace v3d
