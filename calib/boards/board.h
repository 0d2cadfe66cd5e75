// The flat boards that cameras are calibrated with, and what a camera saw of one.
#pragma once

#include <Eigen/Core>
#include <string>
#include <string_view>
#include <vector>

namespace v3d::calib {

enum class BoardKind { kChess, kCharuco };

/// Board frame: metres, right-handed, z = 0 on the print, z out of the printed side. Corners are
/// the places where four squares meet, numbered along x, then along y; corner 0 is the origin.
struct Board {
  BoardKind kind = BoardKind::kChess;
  int corner_columns = 0;  ///< along x
  int corner_rows = 0;     ///< along y
  double square_m = 0;
  double marker_m = 0;       ///< charuco only
  std::string dictionary{};  ///< charuco only: OpenCV's name, "DICT_4X4_1000"
  bool inverted = false;     ///< printed white on black

  int corners() const { return corner_columns * corner_rows; }
  Eigen::Vector3d corner(int index) const {
    const int column = index % corner_columns, row = index / corner_columns;
    return {column * square_m, row * square_m, 0};
  }
  Eigen::Vector3d centre() const { return 0.5 * corner(corners() - 1); }
  /// Turned by half it looks the same: which end is which, no picture of it alone can tell.
  bool looks_same_turned() const {
    return kind == BoardKind::kChess && (corner_columns + corner_rows) % 2 == 0;
  }
  /// As parse_board() reads it.
  std::string text() const;
};

/// "chess:9x6:25mm[:inverted]": inner corners. "charuco:4x5:SQUARE:MARKER:DICT[:inverted]":
/// squares. Throws InputError that tells the syntax.
Board parse_board(std::string_view text);

/// The corners of the board in one picture, whole-image pixels (CameraModel's convention).
struct BoardSighting {
  std::vector<int> corners;  ///< rising
  std::vector<Eigen::Vector2d> pixels;

  int count() const { return static_cast<int>(corners.size()); }
};

/// The same picture read with the board's other end first. Requires board.looks_same_turned().
BoardSighting turned(const Board& board, const BoardSighting& sighting);

}  // namespace v3d::calib
