// Prepares the cameras of a frame set for accumulate_vertex_colours(). Source: the paper, Algorithm
// 1 (visibility).
#pragma once

#include <vector>

#include "recon/texture/accumulate_colours.h"
#include "recon/texture/texture.h"

namespace v3d {

/// Colour masks and point depth buffers of `occluders` (occluding_points()) for the cameras whose
/// frames have pixels, sorted by name. Frames and models stay borrowed.
std::vector<VertexCamera> vertex_cameras(const PointArrays& occluders,
                                         std::vector<TextureCamera> cameras,
                                         const TextureOptions& options);

}  // namespace v3d
