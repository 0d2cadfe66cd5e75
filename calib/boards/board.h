// Boards, observations, initial poses, selection of views.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/geometry/camera_model.h"
#include "base/image/image.h"

namespace v3d::calib {

// Planar calibration boards, and the corners of them that cameras observe.

enum class BoardKind { kChess, kCharuco };

/// A chessboard or ChArUco board.
///
/// Board frame: metres, right-handed, z = 0 on the print, z points out of the printed side. Corners
/// are the points where four squares meet. They are numbered along x first, then along y; corner 0
/// is the origin.
struct Board {
  BoardKind kind = BoardKind::kChess;
  int corner_columns = 0;  ///< along x
  int corner_rows = 0;     ///< along y
  double square_m = 0;
  double marker_m = 0;       ///< ChArUco only
  std::string dictionary{};  ///< ChArUco only: OpenCV's name, such as "DICT_4X4_1000"
  bool inverted = false;     ///< printed white on black

  int corners() const { return corner_columns * corner_rows; }
  Eigen::Vector3d corner(int index) const {
    const int column = index % corner_columns, row = index / corner_columns;
    return {column * square_m, row * square_m, 0};
  }
  Eigen::Vector3d centre() const { return 0.5 * corner(corners() - 1); }
  /// The pattern looks the same after half a turn, so one image cannot show which end is which.
  bool has_half_turn_symmetry() const {
    return kind == BoardKind::kChess && (corner_columns + corner_rows) % 2 == 0;
  }
  /// The text that parse_board() reads.
  std::string text() const;
};

/// Reads a board from the command line: "chess:9x6:25mm[:inverted]" counts inner corners,
/// "charuco:4x5:SQUARE:MARKER:DICT[:inverted]" counts squares. Throws InputError with the syntax.
Board parse_board(std::string_view text);

/// An image with fewer corners of a ChArUco board does not show it.
inline constexpr int kMinObservedCorners = 6;

/// The corners of the board that one image shows, in whole-image pixels (CameraModel's convention).
struct BoardObservation {
  std::vector<int> corners;  ///< in ascending order
  std::vector<Eigen::Vector2d> pixels;

  int count() const { return static_cast<int>(corners.size()); }
};

/// The same observation with the corners numbered from the other end of the board.
/// Requires board.has_half_turn_symmetry().
BoardObservation half_turned(const Board& board, const BoardObservation& observation);

/// The observation or half_turned() of it: the one whose corners are nearer to those of `reference`
/// in the image. Without half-turn symmetry the observation. Both show the same corners.
BoardObservation turned_like(const BoardObservation& reference, const Board& board,
                             const BoardObservation& observation);

/// The observations of one camera of the rig, by instant. An instant is a number that images of the
/// same moment share: a pulse, a frame of synchronised videos, a row of a table of time stamps.
struct CameraObservations {
  std::string name;
  ImageSize size;
  std::map<int64_t, BoardObservation> observations{};
};

// Initial estimates of board poses and of a camera matrix, from observations of a board.
// The adapter of OpenCV's pose and camera estimators. lens/bundle_adjustment.h refines the
// estimates.

/// A pose of the board in the camera frame (metres).
struct BoardPose {
  RigidTransform cam_from_board;
  double rms_px = 0;  ///< root mean square of the reprojection errors
};

/// Up to two poses of the board, the one with the smaller error first (IPPE).
///
/// A small or distant board has a second pose, tilted the other way, which fits nearly as well.
/// Only the lens of `camera` is used, not its pose. Empty where no pose fits.
std::vector<BoardPose> board_poses(const CameraModel& camera, const Board& board,
                                   const BoardObservation& observation);

/// The camera matrix of an undistorted lens with its principal point in the middle of the image.
/// Requires at least one observation. Source: Zhang 2000.
Eigen::Matrix3d initial_camera_matrix(const Board& board, ImageSize size,
                                      std::span<const BoardObservation* const> observations);

/// Reprojection residuals (observed minus projected, pixels) by corner of the observation, through
/// the lens of `camera`; 1e6 for a corner that cannot be projected.
std::vector<Eigen::Vector2d> residuals(const CameraModel& camera, const Board& board,
                                       const RigidTransform& cam_from_board,
                                       const BoardObservation& observation);

/// Root mean square of the lengths of the residuals; 0 for none.
double rms_of(std::span<const Eigen::Vector2d> residuals);

/// A camera with the lens of `lens` and the pose `cam_from_world`.
CameraModel with_pose(const CameraModel& lens, const RigidTransform& cam_from_world);

// View selection: a small, diverse subset of board images for calibration, and image coverage.

/// Indices, in ascending order, of at most `max_views` observations that differ most in image
/// position, distance and tilt (farthest-point selection).
///
/// The observation with most corners comes first, then always the one that is farthest from all
/// selected ones. Near duplicates are never selected. Deterministic.
std::vector<int> select_views(const Board& board, ImageSize size,
                              std::span<const BoardObservation* const> observations, int max_views);

/// The share of the image, 0 to 1, in which corners were observed: of kCoverageColumns x
/// kCoverageRows equal cells, those with at least one corner.
inline constexpr int kCoverageColumns = 10;
inline constexpr int kCoverageRows = 8;
double coverage(ImageSize size, std::span<const BoardObservation* const> observations);
/// The number of corners in each cell, row by row.
std::vector<int> coverage_counts(ImageSize size,
                                 std::span<const BoardObservation* const> observations);

}  // namespace v3d::calib
