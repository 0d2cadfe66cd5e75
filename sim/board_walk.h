// A calibration board that is carried through the simulated studio, and where its corners appear.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/camera_model.h"

namespace v3d::sim {

struct BoardWalkOptions {
  int boards = 200;
  double noise_px = 0.2;  ///< standard deviation of a corner, along x and along y
  uint64_t seed = 1;
};

/// A corner as a camera of the rig sees it.
struct SeenCorner {
  int camera = 0;
  int board = 0;  ///< how many-th stop of the walk
  int corner = 0;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
};

struct BoardWalk {
  std::vector<RigidTransform> world_from_board;
  std::vector<SeenCorner> corners;  ///< by board, by camera, by corner
};

/// `corners`: in the frame of the board, z out of the print. The board is held up in the middle of
/// the studio and turned round, so that it faces all cameras in turn, leaning to every side. A
/// camera sees it where all corners are in its image and the print is turned to it (by less than
/// 65 degrees).
BoardWalk walk_board(const Rig& rig, std::span<const Eigen::Vector3d> corners,
                     const BoardWalkOptions& options);

}  // namespace v3d::sim
