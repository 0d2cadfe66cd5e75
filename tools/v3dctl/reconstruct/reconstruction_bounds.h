// Default bounds of the reconstruction, where neither the user nor a studio file gives them.
#pragma once

#include "base/geometry/box.h"
#include "base/geometry/camera_model.h"

namespace v3d::ctl {

/// Number of views below which space is empty: 4, and with few cameras all but one, because a voxel
/// outside of one camera's image may belong to the body.
int default_min_views(int cameras);

/// Box around the points that at least `min_cameras` cameras see (world frame, metres). Points are
/// limited to a ball around the point nearest to all optical axes, with the median distance of the
/// cameras as radius, and sampled on a 64^3 grid.
/// Throws InputError when there is no such point.
Box observed_bounds(const Rig& rig, int min_cameras);

/// observed_bounds() by at least half the cameras and at least `min_views` of them.
Box default_bounds(const Rig& rig, int min_views);

}  // namespace v3d::ctl
