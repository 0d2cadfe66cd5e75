// Cameras of one make whose colours differ all the same.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string_view>

namespace v3d::sim {

/// What a sensor makes of the light, 0 to 1: black + matrix * light.
struct SensorColour {
  Eigen::Matrix3f matrix = Eigen::Matrix3f::Identity();
  Eigen::Vector3f black = Eigen::Vector3f::Zero();
};

/// `spread` 0: all are alike. 1: as unmatched cameras are, gains within 15 % for every colour,
/// cross-talk of up to 5 % between two, black levels up to 6 grey values.
SensorColour sensor_colour(std::string_view camera, double spread, uint64_t seed);

}  // namespace v3d::sim
