// Vertex visibility by point depth buffers: faster and coarser than by depth buffers.
#pragma once

#include "recon/visibility/point_depth_buffer.h"
#include "recon/visibility/vertex_visibility.h"

namespace v3d::recon {

/// Like test_visibility(), with the point depth buffer of the mesh in `camera`. Cells are wider
/// than pixels, so the tolerance grows with the slant across a cell. A vertex outside the valid
/// cells is not seen; a default-constructed buffer has none.
void test_cell_visibility(const SurfaceCamera& camera, const PointDepthBuffer& depth,
                          const PointBlock& positions, const PointBlock& normals,
                          const VisibilityOptions& options, VertexVisibility& visibility);

}  // namespace v3d::recon
