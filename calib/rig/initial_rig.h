// An initial rig for a studio that is not calibrated yet.
#pragma once

#include <string>
#include <vector>

#include "base/geometry/box.h"
#include "base/geometry/camera_model.h"

namespace v3d::calib {

/// Assumed camera poses and lenses, sufficient to record a take of boards.
///
/// The cameras have no distortion. They stand at equal distances on a level ring around `space`
/// (world frame, metres, z up), in the order of `names`. They look at its centre from where the
/// whole of it is in their images. `horizontal_fov_deg`: above 0 and below 180.
/// Requires is_image_size(size). Pure.
Rig initial_rig(const std::vector<std::string>& names, ImageSize size, double horizontal_fov_deg,
                const Box& space);

}  // namespace v3d::calib
