// KHR_draco_mesh_compression: Google's Draco behind glTF. Only draco_mesh.cc sees its headers.
#pragma once

#include "v3dctl/export/vertex_streams.h"

namespace v3d::ctl {

/// What a decoder makes of the bytes, in an order of its own.
struct DracoMesh {
  std::vector<uint8_t> bytes;
  std::vector<int> ids;  ///< of the attributes, in the order of the streams
  size_t vertices = 0;
  size_t triangles = 0;
  Eigen::Vector3f low, high;  ///< of the positions
};

/// Requires POSITION as floats, which come back on `grid`, COLOR_0 as floats from 0 to 1, which
/// come back in kLinearBits, and of all others bytes, which come back as they are. Triangles that
/// have one vertex twice are left out, and vertices without a triangle. As small as Draco makes it.
/// Throws std::runtime_error for what Draco cannot encode: no triangles.
DracoMesh compress_with_draco(const VertexStreams& mesh, const PositionGrid& grid);

}  // namespace v3d::ctl
