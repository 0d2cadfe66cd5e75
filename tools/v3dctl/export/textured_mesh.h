// A mesh with texture coordinates, as file formats require it.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/geometry/mesh.h"
#include "recon/texture/texture_atlas.h"

namespace v3d::ctl {

/// A vertex at a seam occurs once for each chart that it belongs to.
struct TexturedMesh {
  Mesh mesh;  ///< without colours; the triangles in the order of the original
  /// One per vertex: u to the right and v downwards as in glTF, from 0 to 65535 over the image.
  std::vector<std::array<uint16_t, 2>> coordinates;
  std::vector<uint32_t> source;  ///< one per vertex: its number in the original
};

/// Leaves out vertices without a triangle. `layout` is that of the mesh.
TexturedMesh with_coordinates(const Mesh& mesh, const recon::AtlasLayout& layout);

}  // namespace v3d::ctl
