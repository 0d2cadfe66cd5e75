// Similarity transforms of rigs: floor frame, comparison.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/geometry/camera_model.h"
#include "calib/boards/board.h"

namespace v3d::calib {

// Comparison of a rig with its previous calibration, and similarity transforms of rigs.

/// Differences between two calibrations of a rig; cameras correspond by name.
struct RigDifference {
  /// Median ratio of the distances between cameras, now to previous; 1 where it is unknown.
  double scale = 1;
  /// At least half of the distances have this ratio; else cameras were moved.
  bool same_shape = true;
  /// Pairs of cameras with exchanged positions.
  std::vector<std::pair<std::string, std::string>> swapped;
};

/// The two worlds may differ. Cameras that all have the same position in `previous` (calibrated
/// lenses only) give no difference.
RigDifference compare_rigs(const Rig& now, const Rig& previous);

/// x -> rigid * (scale * x).
struct Similarity {
  double scale = 1;
  RigidTransform rigid;
  Eigen::Vector3d operator*(const Eigen::Vector3d& p) const { return rigid * (scale * p); }
};

/// The least-squares similarity that maps `from` to `to`. Requires three or more points that are
/// not collinear. `with_scale` false: the scale is 1. Source: Umeyama 1991.
Similarity align_points(const std::vector<Eigen::Vector3d>& from,
                        const std::vector<Eigen::Vector3d>& to, bool with_scale);

/// The rig in the world frame `new`.
Rig transformed_rig(const Rig& rig, const Similarity& new_from_old);

// World frame and scale of a rig, from a board that lies on the floor.

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

/// A sentence where two cameras disagree by more than a degree, else none.
std::vector<std::string> find_weaknesses(const FloorFit& fit);

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
