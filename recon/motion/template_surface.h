// Template surfaces: adaptive simplification of a reconstructed mesh.
#pragma once

#include <cstddef>

#include "base/geometry/mesh.h"

namespace v3d::recon {

/// The surface of `mesh` with about `triangles` triangles: large ones where it is flat, small ones
/// where it bends. Vertices are vertices of `mesh`, with their colours; unused ones are left out.
/// The topology does not change, so the result can have more triangles than asked for. A closed
/// mesh stays closed. A mesh with no more triangles than that keeps them all.
///
/// Source: quadric error metric of Garland and Heckbert, SIGGRAPH 1997, as in meshoptimizer.
Mesh simplified(const Mesh& mesh, size_t triangles);

}  // namespace v3d::recon
