// Cameras whose pictures of one instant are not of one instant, told by a board that moved.
#pragma once

#include <cstdint>
#include <vector>

#include "calib/rig/pair_poses.h"

namespace v3d::calib {

/// How many instants a camera's pictures come too late (its picture labelled n shows n minus so
/// many), negative: too early, by camera; against what most cameras say. Where the board does not
/// move nothing can be told: then 0. Looks at most kMostInstantsOff to either side, which needs
/// instants that are neighbours (n, n + 1, ...); each camera is held against those with which it
/// shares most of `pairs`.
inline constexpr int kMostInstantsOff = 5;
std::vector<int> instants_late(const std::vector<CameraPoses>& cameras,
                               const std::vector<PairPose>& pairs);

}  // namespace v3d::calib
