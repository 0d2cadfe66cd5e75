// Prediction of the motion of a deformation graph from one pulse to another.
#pragma once

#include <span>
#include <vector>

#include "recon/motion/deformation_graph.h"

namespace v3d::recon {

/// The motion when each node turns and moves on as it did from `before` to `now`. `ratio`: the time
/// from `now` to the result, as a multiple of the time from `before` to `now`; 1 for pulses that
/// are evenly spaced. Requires motions of the same nodes and ratio > 0.
std::vector<NodeMotion> with_same_speed(std::span<const NodeMotion> before,
                                        std::span<const NodeMotion> now, double ratio);

}  // namespace v3d::recon
