// The part of the world to reconstruct when nobody says.
#pragma once

#include "base/camera_model.h"
#include "base/geometry.h"

namespace v3d::ctl {

/// Where cameras look together: the box round all points that at least `views` cameras see, no
/// farther from the point nearest to all optical axes than the cameras are (median). Sampled on a
/// 64^3 lattice. Throws InputError when there is no such point.
Box common_view(const Rig& rig, int views);

}  // namespace v3d::ctl
