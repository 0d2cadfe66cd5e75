// Cameras that run free expose between the instants of the others. What is left of that after whole
// instants are put right shows in the finished calibration: corners miss along their motion.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "calib/rig/pair_poses.h"

namespace v3d::calib {

/// How fast a corner moves in the image at an instant, pixels per instant, from the observations
/// before and behind; empty where the camera has neither.
std::optional<Eigen::Vector2d> corner_velocity(
    const std::map<int64_t, BoardObservation>& observations, int64_t instant, int corner);

/// A corner that moves, and by how much the calibration misses it (seen less projected).
struct MovingCorner {
  Eigen::Vector2d velocity;
  Eigen::Vector2d miss;
};

/// The part of an instant by which a camera is late, by least squares; 0 where the motion explains
/// less than a tenth of the misses' squares or than 0.02 px of them, or hardly anything moves.
double part_late(std::span<const MovingCorner> corners);

}  // namespace v3d::calib
