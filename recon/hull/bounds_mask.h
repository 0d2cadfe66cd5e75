// Bounds mask: the pixels of a camera that can show the reconstructed space.
#pragma once

#include "base/geometry/box.h"
#include "base/geometry/camera_model.h"
#include "base/image/mask.h"

namespace v3d {

/// The pixels whose rays meet `box` (world, metres), in blocks of 4 x 4 pixels: a block is set when
/// the ray of one of its corners meets the box. The mask exceeds the exact outline by at most half
/// a block.
Mask bounds_mask(const Box& box, const CameraModel& camera);

}  // namespace v3d
