// Boards found in pictures: the adapter of OpenCV's chessboard and ArUco detectors.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "base/image.h"
#include "calib/board.h"

namespace v3d::calib {

/// Not for use by several threads at a time; copies are independent.
class BoardDetector {
 public:
  explicit BoardDetector(Board board);

  const Board& board() const { return board_; }

  /// The corners of the board, a tenth of a pixel or better. A chessboard is found whole or not; of
  /// a ChArUco board at least six corners that do not lie on a line. Where the board looks the same
  /// when turned by half, which end comes first is arbitrary. Any pixel format.
  std::optional<BoardSighting> find(ImageView image) const;

  /// For a picture in which find() finds nothing: a sentence on what is there instead, such as a
  /// board of another size or a mirrored print. Empty where nothing is recognised. Takes much
  /// longer than find().
  std::optional<std::string> explain(ImageView image) const;

 private:
  struct Charuco;
  Board board_;
  std::shared_ptr<const Charuco> charuco_;  ///< shared: immutable, and OpenCV's cannot be copied
};

}  // namespace v3d::calib
