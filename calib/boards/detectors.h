// Boards and charts in images: adapter of OpenCV.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>

#include "base/geometry/camera_model.h"
#include "base/image/image.h"
#include "calib/boards/board.h"
#include "calib/colour/colour_fit.h"

// Detection of calibration boards in images: the adapter of OpenCV's chessboard and ArUco
// detectors.

namespace cv {
class Mat;
}

namespace v3d::calib {

/// What an image shows in place of the expected board.
struct BoardDiagnosis {
  std::string text;  ///< one sentence
  /// Perhaps only a part of a larger board was found: prefer the diagnosis of another image.
  bool may_be_part = false;
};

/// Finds the corners of one kind of board. Images may have any pixel format.
///
/// Corners are accurate to 0.1 px. A chessboard is found as a whole or not at all; of a ChArUco
/// board, at least six corners that are not collinear. Where the board has half-turn symmetry, the
/// end with corner 0 is arbitrary.
/// Threads: const member functions may run concurrently.
class BoardDetector {
 public:
  explicit BoardDetector(Board board);

  const Board& board() const { return board_; }

  /// The board in `image`, or nothing.
  std::optional<BoardObservation> find(ImageView image) const;

  /// Like find(), with a more exhaustive search for small or slanted boards; takes much longer.
  std::optional<BoardObservation> find_small(ImageView image) const;

  /// Like find(), with a prediction of the board's pose that is correct to about two squares. The
  /// world frame of `camera` is the board frame. The image is first rectified to a frontal view
  /// through the lens model, so the board may be slanted by any angle.
  std::optional<BoardObservation> find_at(ImageView image, const CameraModel& camera) const;

  /// For an image in which find() finds nothing: what is there instead, such as a board of another
  /// size or a mirrored print. Empty where nothing is recognised. Of a chessboard that is not seen
  /// well, the size may be that of a part. Takes much longer than find().
  std::optional<BoardDiagnosis> diagnose(ImageView image) const;

 private:
  struct Charuco;
  class FrontalView;
  cv::Mat prepared(ImageView image) const;
  std::optional<BoardObservation> find_in(const cv::Mat& grey) const;

  Board board_;
  std::shared_ptr<const Charuco> charuco_;  ///< shared: immutable, and OpenCV's cannot be copied
};

// Detection of colour charts with 24 patches: the adapter of OpenCV's detector (mcc).

/// Mean R, G, B of each patch, grey values 0 to 255 in linear light, from dark skin to black.
using ChartColours = std::array<Eigen::Vector3d, 24>;

/// The chart in one image of linear light, or nothing.
///
/// `image`: any pixel format with colour. The chart must be completely visible, at least about 150
/// px wide, and only slightly slanted.
std::optional<ChartColours> find_chart(ImageView image);

}  // namespace v3d::calib
