// A simulated calibration recording: board poses in the studio, and the corners that cameras
// observe.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/geometry/camera_model.h"

namespace v3d::sim {

struct BoardWalkOptions {
  int boards = 200;
  double noise_px = 0.2;  ///< standard deviation of a corner, along x and along y
  uint64_t seed = 1;
};

/// One corner in one image.
struct ObservedCorner {
  int camera = 0;
  int board = 0;  ///< index into BoardWalk::world_from_board
  int corner = 0;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
};

struct BoardWalk {
  std::vector<RigidTransform> world_from_board;
  std::vector<ObservedCorner> corners;  ///< by board, by camera, by corner
};

/// Board poses in the middle of the studio, which face all cameras in turn with varying tilt.
///
/// `corners`: board frame, metres, z out of the print. A camera observes the board where all
/// corners are in its image and its direction is within 65 degrees of the board normal.
/// Deterministic.
BoardWalk walk_board(const Rig& rig, std::span<const Eigen::Vector3d> corners,
                     const BoardWalkOptions& options);

}  // namespace v3d::sim
