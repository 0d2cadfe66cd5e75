// The outer surface of the performer, which is the ground truth for reconstructions. performer_at()
// also has surfaces inside other parts.
#pragma once

#include "base/geometry/mesh.h"
#include "sim/performer/performer.h"

namespace v3d::sim {

/// All triangles without a vertex inside another part, with vertex colours of paint(). Gaps of
/// about a triangle's size remain where parts meet.
Mesh outer_surface(const std::vector<Part>& parts, uint64_t seed);

/// Whether `point` is inside a closed, outward-oriented mesh (winding number along a ray).
bool is_inside(const Mesh& mesh, const Eigen::Vector3f& point);

}  // namespace v3d::sim
