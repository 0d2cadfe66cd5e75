// Where a surface goes through itself.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "base/mesh.h"

namespace v3d {

/// Two triangles, the one with the lower number first.
using Crossing = std::pair<uint32_t, uint32_t>;

/// Every pair of triangles that cross although they share no vertex: an edge of one goes through
/// the inside of the other. Triangles that only touch, or lie in one plane, do not count. Exact up
/// to the rounding of double precision. Rising; the same for any number of threads.
std::vector<Crossing> self_intersections(const Mesh& mesh);

/// Only the pairs that one of `among` (rising numbers of triangles) takes part in.
std::vector<Crossing> self_intersections(const Mesh& mesh, std::span<const uint32_t> among);

}  // namespace v3d
