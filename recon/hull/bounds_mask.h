// The part of an image that can show anything of the space that is reconstructed.
#pragma once

#include "base/camera_model.h"
#include "base/geometry.h"
#include "base/mask.h"

namespace v3d {

/// The pixels where the camera looks through the box, to blocks of 4 by 4 pixels: a block is in
/// when the ray of one of its corners meets the box, at most half a block beyond the true outline.
Mask bounds_mask(const Box& box, const CameraModel& camera);

}  // namespace v3d
