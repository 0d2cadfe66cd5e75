// Candidate cameras of a plan: positions around the space, directions and lenses.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "base/geometry/camera_model.h"

namespace v3d::plan {

/// What carries cameras.
enum class Mount : uint8_t {
  kWall,    ///< vertical walls at the margin around the sides of the space
  kRail,    ///< an ellipse inside these walls, which touches each in its middle
  kCeiling  ///< the horizontal rectangle inside these walls, at the largest height
};

struct MountOptions {
  std::vector<Mount> mounts = {Mount::kWall};
  double margin_m = 1.5;  ///< from the sides of the space to the walls
  double low_m = 0.3;     ///< heights above the floor
  double high_m = 2.5;
  double step_m = 0.5;  ///< between neighbouring positions
};

struct LensOptions {
  std::vector<double> focal_mm;
  double sensor_width_mm = 7.2;  ///< 1/1.8 inch, 4:3
  ImageSize size{1024, 768};
};

/// Positions on all mounts that are outside of `space`; world, metres. Their distance is about
/// the step, more around a large space. Empty where the space leaves no room below the ceiling.
std::vector<Eigen::Vector3d> candidate_positions(const Box& space, const MountOptions& options);

/// Points of the space to aim at: in its middle and at half the way to its sides, at three heights
/// of a performer.
std::vector<Eigen::Vector3d> candidate_targets(const Box& space);

/// An ideal camera without distortion, its principal point in the middle of the image.
CameraModel ideal_camera(const LensOptions& options, double focal_mm, const Eigen::Vector3d& eye,
                         const Eigen::Vector3d& target);

}  // namespace v3d::plan
