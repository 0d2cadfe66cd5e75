// Axis-aligned boxes.
#pragma once

#include <Eigen/Core>
#include <string_view>

namespace v3d {

/// An axis-aligned box in world coordinates, metres.
struct Box {
  Eigen::Vector3d min = Eigen::Vector3d::Zero();
  Eigen::Vector3d max = Eigen::Vector3d::Zero();

  Eigen::Vector3d size() const { return max - min; }
  Eigen::Vector3d center() const { return 0.5 * (min + max); }
  bool contains(const Eigen::Vector3d& p) const {
    return (p.array() >= min.array()).all() && (p.array() <= max.array()).all();
  }
};

/// Parses "X0,Y0,Z0,X1,Y1,Z1" in metres. Throws InputError unless X0 < X1, Y0 < Y1 and Z0 < Z1.
Box parse_bounds(std::string_view text);

}  // namespace v3d
