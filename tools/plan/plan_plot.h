// Picture of a plan.
#pragma once

#include <string>

#include "base/geometry/camera_model.h"
#include "base/geometry/rigid_transform.h"

namespace v3d::plan {

/// An SVG picture: the plan view with the coverage of the floor, and the elevation along y.
///
/// The colour of a cell of the floor is the number of cameras that have a standing person of 1.8 m
/// there inside their image. The first `fixed` cameras of the rig have another colour.
std::string plot_of(const Rig& rig, size_t fixed, const Box& space);

}  // namespace v3d::plan
