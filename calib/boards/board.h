// Planar calibration boards, and the corners of them that cameras observe.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "base/image/image.h"

namespace v3d::calib {

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

/// The corners of the board that one image shows, in whole-image pixels (CameraModel's convention).
struct BoardObservation {
  std::vector<int> corners;  ///< in ascending order
  std::vector<Eigen::Vector2d> pixels;

  int count() const { return static_cast<int>(corners.size()); }
};

/// The same observation with the corners numbered from the other end of the board.
/// Requires board.has_half_turn_symmetry().
BoardObservation half_turned(const Board& board, const BoardObservation& observation);

/// The observations of one camera of the rig, by instant. An instant is a number that images of the
/// same moment share: a pulse, a frame of synchronised videos, a row of a table of time stamps.
struct CameraObservations {
  std::string name;
  ImageSize size;
  std::map<int64_t, BoardObservation> observations{};
};

}  // namespace v3d::calib
