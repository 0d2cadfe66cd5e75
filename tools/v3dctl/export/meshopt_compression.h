// EXT_meshopt_compression: meshoptimizer's codecs behind glTF. Only meshopt_mesh.cc sees its
// header.
#pragma once

#include <span>

#include "v3dctl/export/vertex_streams.h"

namespace v3d::ctl {

/// Triangles and vertices in the order that the codecs are made for; vertices without a triangle
/// are left out.
void order_for_meshopt(VertexStreams& mesh);

/// Version 0 of the codec of vertices, version 1 of that of triangles: what the extension asks for.
std::vector<uint8_t> compress_vertices(const VertexStream& stream, size_t vertices);
std::vector<uint8_t> compress_triangles(std::span<const uint32_t> indices, size_t vertices);

}  // namespace v3d::ctl
