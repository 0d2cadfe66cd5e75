// The part of the performer's surface that can be seen from outside: what a reconstruction is
// measured against. (performer_at() is a union of closed parts; much of it lies inside other
// parts.)
#pragma once

#include "base/mesh.h"
#include "sim/performer.h"

namespace v3d::sim {

/// The union of the parts without the triangles that have a corner inside another part, coloured by
/// paint(). It is open along the seams where parts meet, by about the size of a triangle.
Mesh outer_surface(const std::vector<Part>& parts, uint64_t seed);

/// True when `point` lies inside a closed, outward-oriented mesh (by the winding number along a
/// ray).
bool is_inside(const Mesh& mesh, const Eigen::Vector3f& point);

}  // namespace v3d::sim
