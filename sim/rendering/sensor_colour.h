// Simulated differences between the colour responses of cameras.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string_view>

namespace v3d::sim {

/// The response of a sensor to light (0 to 1): black + matrix * light.
struct SensorColour {
  Eigen::Matrix3f matrix = Eigen::Matrix3f::Identity();
  Eigen::Vector3f black = Eigen::Vector3f::Zero();
};

/// A random response for a camera name. `spread` 0: all cameras are equal. `spread` 1: gains within
/// 15 %, cross-talk up to 5 % between two channels, black levels up to 6 grey values.
/// Deterministic.
SensorColour sensor_colour(std::string_view camera, double spread, uint64_t seed);

}  // namespace v3d::sim
