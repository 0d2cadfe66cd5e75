// World origin, up and scale from a board that lies on the floor.
#pragma once

#include <optional>
#include <vector>

#include "base/camera_model.h"
#include "calib/rig/pair_poses.h"
#include "calib/rig/rig_comparison.h"

namespace v3d::calib {

struct FloorFit {
  /// In the new world the print is z = 0, z out of it; corner 0 is the origin, x along the columns.
  Rig rig;
  Similarity new_from_old;
  /// The board's lengths by the rig's, before: 1 where the rig's scale was right.
  double board_by_rig = 1;
  bool scaled = false;  ///< the rig took the board's scale, because they differed by more than 1 %
  double rms_px = 0;
  /// The largest angle between the board's normals as two cameras see it, each for itself: what the
  /// rig's own directions are worth, degrees.
  double disagreement_deg = 0;
  std::vector<int> cameras;  ///< of the rig, that saw it
};

/// Where the board lies, and how large it is, by the rays of its corners alone: board from world,
/// with scale. Empty where no four corners are seen by two cameras.
std::optional<Similarity> place_board(const Rig& rig, const Board& board,
                                      const std::vector<CameraObservations>& cameras);

/// `cameras`: all that saw the board, which lay still; where there are several pictures the median
/// place of each corner counts. Every camera must be in the rig, by name and size. A board that
/// looks the same when turned by half has its origin at either end. Throws InputError where fewer
/// than two cameras saw the board, where it does not fit the rig, and where the cameras are below
/// it.
FloorFit fit_floor(const Rig& rig, const Board& board,
                   const std::vector<CameraObservations>& cameras);

}  // namespace v3d::calib
