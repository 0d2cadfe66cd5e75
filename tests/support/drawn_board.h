// Pictures of chessboards whose corners are known.
#pragma once

#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <vector>

namespace v3d::test {

/// How a camera sees a chessboard of 9x6 inner corners.
struct BoardView {
  static constexpr int kColumns = 9, kRows = 6;

  double square_px = 30;  ///< at its middle
  double tilt_rad = 0.5;
  double blur_px = 0.8;
  double noise = 4;  ///< grey values
};

/// A picture of 640x480 pixels with the true positions of its corners.
struct BoardPicture {
  cv::Mat grey;  ///< 8 bits
  std::vector<cv::Point2f> corners;
  std::vector<float> spacings;  ///< to the nearest neighbour
};

/// Image from board, whose unit is a square and whose first inner corner is at (0, 0).
inline cv::Matx33d homography(const BoardView& view) {
  const double f = 560, distance = f / view.square_px;
  cv::Matx33d rotation;
  cv::Rodrigues(cv::Vec3d(view.tilt_rad, -0.6 * view.tilt_rad, 0.3), rotation);
  const cv::Vec3d middle((BoardView::kColumns - 1) / 2.0, (BoardView::kRows - 1) / 2.0, 0);
  const cv::Vec3d shift = cv::Vec3d(0.1, -0.1, distance) - rotation * middle;
  const cv::Matx33d camera(f, 0, 320, 0, f, 240, 0, 0, 1);
  return camera * cv::Matx33d(rotation(0, 0), rotation(0, 1), shift[0], rotation(1, 0),
                              rotation(1, 1), shift[1], rotation(2, 0), rotation(2, 1), shift[2]);
}

inline cv::Point2d mapped(const cv::Matx33d& h, double x, double y) {
  const cv::Vec3d p = h * cv::Vec3d(x, y, 1);
  return {p[0] / p[2], p[1] / p[2]};
}

/// The grey value of the print at a position on the board.
inline double print_at(const cv::Point2d& p) {
  const bool on_squares =
      p.x > -1 && p.x < BoardView::kColumns && p.y > -1 && p.y < BoardView::kRows;
  if (!on_squares) return 200;
  return (static_cast<int>(std::floor(p.x)) + static_cast<int>(std::floor(p.y))) % 2 == 0 ? 40
                                                                                          : 200;
}

inline BoardPicture drawn_board(const BoardView& view, std::mt19937& random) {
  constexpr int kSamples = 5;  // along each side of a pixel
  const cv::Matx33d image_from_board = homography(view);
  const cv::Matx33d board_from_image = image_from_board.inv();
  cv::Mat light(480, 640, CV_32F);
  for (int y = 0; y < light.rows; ++y) {
    for (int x = 0; x < light.cols; ++x) {
      double sum = 0;
      for (int i = 0; i < kSamples * kSamples; ++i) {
        const double dx = (i % kSamples + 0.5) / kSamples - 0.5;
        const double dy = (i / kSamples + 0.5) / kSamples - 0.5;
        sum += print_at(mapped(board_from_image, x + dx, y + dy));
      }
      light.at<float>(y, x) = static_cast<float>(sum / (kSamples * kSamples));
    }
  }
  cv::GaussianBlur(light, light, {}, view.blur_px);
  std::normal_distribution<float> noise(0, static_cast<float>(view.noise));
  for (auto& value : cv::Mat_<float>(light)) value += noise(random);
  BoardPicture picture;
  light.convertTo(picture.grey, CV_8U);
  for (int row = 0; row < BoardView::kRows; ++row) {
    for (int column = 0; column < BoardView::kColumns; ++column) {
      picture.corners.emplace_back(mapped(image_from_board, column, row));
      const cv::Point2d aside = mapped(image_from_board, column + 1, row);
      const cv::Point2d below = mapped(image_from_board, column, row + 1);
      const cv::Point2d corner = mapped(image_from_board, column, row);
      picture.spacings.push_back(
          static_cast<float>(std::min(cv::norm(aside - corner), cv::norm(below - corner))));
    }
  }
  return picture;
}

}  // namespace v3d::test
