// Cameras made ready to look at the vertices of one mesh: the paper's Algorithm 1 (visibility).
#pragma once

#include <vector>

#include "recon/texture/accumulate_colours.h"
#include "recon/texture/texture.h"

namespace v3d {

/// Masks, and depth cells of `occluders` (see occluding_points()), for the cameras whose frames
/// have pixels, in the order of their names. What the cameras borrow stays borrowed.
std::vector<VertexCamera> vertex_cameras(const PointArrays& occluders,
                                         std::vector<TextureCamera> cameras,
                                         const TextureOptions& options);

}  // namespace v3d
