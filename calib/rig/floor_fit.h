// World frame and scale of a rig, from a board that lies on the floor.
#pragma once

#include <optional>
#include <vector>

#include "base/geometry/camera_model.h"
#include "calib/boards/board.h"
#include "calib/rig/rig_comparison.h"

namespace v3d::calib {

struct FloorFit {
  /// World frame: metres, the print is z = 0, z points out of it, corner 0 is the origin, x is
  /// along the columns of the board.
  Rig rig;
  Similarity new_from_old;
  /// Ratio of the board's lengths to those of the given rig; 1 where the rig's scale is correct.
  double board_by_rig = 1;
  bool scaled = false;  ///< the rig was scaled, because the lengths differed by more than 1 %
  double rms_px = 0;
  /// The largest angle between the board normals that two cameras observe, each by itself, degrees.
  /// It shows how accurate the directions of the cameras are.
  double disagreement_deg = 0;
  std::vector<int> cameras;  ///< indices of the cameras in the rig that observed the board
};

/// Pose and size of the board by triangulation of its corners. Empty where fewer than four corners
/// are observed by two cameras. Returns board_from_world with scale.
std::optional<Similarity> locate_board(const Rig& rig, const Board& board,
                                       const std::vector<CameraObservations>& cameras);

/// Transforms a rig to the world frame of the floor.
///
/// `cameras`: all cameras that observed the board at rest; the median position of each corner over
/// all instants is used. A board with half-turn symmetry may have its origin at either end.
/// Throws InputError where the rig lacks a camera or has it with another image size, where fewer
/// than two cameras observed the board, where the board does not fit the rig, and where a camera is
/// below the floor. Pure.
FloorFit fit_floor(const Rig& rig, const Board& board,
                   const std::vector<CameraObservations>& cameras);

}  // namespace v3d::calib
