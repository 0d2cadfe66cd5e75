// The part of the world to reconstruct when nobody says.
#pragma once

#include "base/camera_model.h"
#include "base/geometry.h"
#include "base/mask.h"

namespace v3d::ctl {

/// Where cameras look together: the box round all points that at least `views` cameras see, no
/// farther from the point nearest to all optical axes than the cameras are (median). Sampled on a
/// 64^3 lattice. Throws InputError when there is no such point.
Box common_view(const Rig& rig, int views);

/// The pixels where the camera looks through the box, to blocks of 4 by 4 pixels: a block is in
/// when the ray of one of its corners meets the box, at most half a block beyond the true outline.
Mask view_of(const Box& box, const CameraModel& camera);

}  // namespace v3d::ctl
