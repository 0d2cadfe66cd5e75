// Procedural background of the studio: tiled floor, panelled round wall, ceiling with fluorescent
// tubes.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "base/geometry/camera_model.h"

namespace v3d::sim {

/// Linear R, G, B (0 to 1) seen from `eye` (world, metres) along `direction` (any length).
Eigen::Vector3f room_colour(const Eigen::Vector3d& eye, const Eigen::Vector3d& direction,
                            uint64_t seed);

/// The background of every pixel of a camera, row-major. Takes about 0.1 s for 1024x768.
std::vector<Eigen::Vector3f> room_image(const CameraModel& camera, uint64_t seed);

}  // namespace v3d::sim
