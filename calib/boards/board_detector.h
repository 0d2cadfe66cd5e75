// Boards found in pictures: the adapter of OpenCV's chessboard and ArUco detectors.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "base/camera_model.h"
#include "base/image.h"
#include "calib/boards/board.h"

namespace cv {
class Mat;
}

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

  /// As find(), and tries harder where the board is small or slanted; takes much longer.
  std::optional<BoardSighting> find_small(ImageView image) const;

  /// As find(), where it is known, to a square or two, where the board is: `camera` stands in the
  /// board's frame (its world is the board). The image is first turned, through the lens model,
  /// into one that looks straight at the board, so that it may be as slanted as it likes.
  std::optional<BoardSighting> find_near(ImageView image, const CameraModel& camera) const;

  /// For a picture in which find() finds nothing: a sentence on what is there instead, such as a
  /// board of another size or a mirrored print. Empty where nothing is recognised. Takes much
  /// longer than find().
  std::optional<std::string> explain(ImageView image) const;

 private:
  struct Charuco;
  class Straight;
  cv::Mat prepared(ImageView image) const;
  std::optional<BoardSighting> find_in(const cv::Mat& grey) const;

  Board board_;
  std::shared_ptr<const Charuco> charuco_;  ///< shared: immutable, and OpenCV's cannot be copied
};

}  // namespace v3d::calib
