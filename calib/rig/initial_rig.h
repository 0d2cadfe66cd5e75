// Where the cameras of a studio may stand, before anybody has measured it.
#pragma once

#include <string>
#include <vector>

#include "base/camera_model.h"
#include "base/geometry.h"

namespace v3d::calib {

/// Enough to arm a take of boards with: cameras without distortion, as far apart as they can be on
/// a level ring round `space` (metres, z up), in the order of `names`, all looking at its middle
/// from where the whole of it is in their images. `across_deg`: the angle that an image is wide,
/// above 0 and below 180. Requires is_image_size(size). Pure.
Rig guessed_rig(const std::vector<std::string>& names, ImageSize size, double across_deg,
                const Box& space);

}  // namespace v3d::calib
