#include "calib/boards/saddle_fit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

namespace v3d::calib {
namespace {

using testing::Lt;

constexpr int kColumns = 9, kRows = 6;
const cv::Size kSize{640, 480};

/// How a camera sees a chessboard of 9x6 inner corners.
struct View {
  double square_px = 30;  ///< at its middle
  double tilt_rad = 0.5;
  double blur_px = 0.8;
  double noise = 4;  ///< grey values
};

/// A picture with the true positions of its corners.
struct Picture {
  cv::Mat grey;
  std::vector<cv::Point2f> corners;
  std::vector<float> spacings;
};

/// Image from board, whose unit is a square and whose first inner corner is at (0, 0).
cv::Matx33d homography(const View& view) {
  const double f = 560, distance = f / view.square_px;
  cv::Matx33d rotation;
  cv::Rodrigues(cv::Vec3d(view.tilt_rad, -0.6 * view.tilt_rad, 0.3), rotation);
  const cv::Vec3d middle((kColumns - 1) / 2.0, (kRows - 1) / 2.0, 0);
  const cv::Vec3d shift = cv::Vec3d(0.1, -0.1, distance) - rotation * middle;
  const cv::Matx33d camera(f, 0, 320, 0, f, 240, 0, 0, 1);
  return camera * cv::Matx33d(rotation(0, 0), rotation(0, 1), shift[0], rotation(1, 0),
                              rotation(1, 1), shift[1], rotation(2, 0), rotation(2, 1), shift[2]);
}

cv::Point2d mapped(const cv::Matx33d& h, double x, double y) {
  const cv::Vec3d p = h * cv::Vec3d(x, y, 1);
  return {p[0] / p[2], p[1] / p[2]};
}

/// The grey value of the print at a place of the board.
double print_at(const cv::Point2d& p) {
  const bool on_squares = p.x > -1 && p.x < kColumns && p.y > -1 && p.y < kRows;
  if (!on_squares) return 200;
  return (static_cast<int>(std::floor(p.x)) + static_cast<int>(std::floor(p.y))) % 2 == 0 ? 40
                                                                                          : 200;
}

Picture draw(const View& view, std::mt19937& random) {
  constexpr int kSamples = 5;  // along each side of a pixel
  const cv::Matx33d image_from_board = homography(view);
  const cv::Matx33d board_from_image = image_from_board.inv();
  cv::Mat light(kSize, CV_32F);
  for (int y = 0; y < kSize.height; ++y) {
    for (int x = 0; x < kSize.width; ++x) {
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
  Picture picture;
  light.convertTo(picture.grey, CV_8U);
  for (int row = 0; row < kRows; ++row) {
    for (int column = 0; column < kColumns; ++column) {
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

/// RMS error of the refined corners, pixels, when detection is off by `start_px` in each
/// coordinate.
double rms_error(const View& view, double start_px) {
  std::mt19937 random(1);
  const Picture picture = draw(view, random);
  std::normal_distribution<float> error(0, static_cast<float>(start_px));
  std::vector<cv::Point2f> points = picture.corners;
  for (cv::Point2f& point : points) point += cv::Point2f(error(random), error(random));
  refine_saddles(picture.grey, picture.spacings, kChessSaddles, points);
  double sum = 0;
  for (size_t i = 0; i < points.size(); ++i) {
    const cv::Point2f d = points[i] - picture.corners[i];
    sum += d.dot(d);
  }
  return std::sqrt(sum / static_cast<double>(points.size()));
}

TEST(SaddleFit, finds_corners_to_a_few_hundredths_of_a_pixel) {
  EXPECT_THAT(rms_error({}, 0.3), Lt(0.04)) << "tilted";
  EXPECT_THAT(rms_error({.square_px = 45, .tilt_rad = 0.8}, 0.5), Lt(0.04)) << "near and steep";
  EXPECT_THAT(rms_error({.square_px = 12}, 0.2), Lt(0.05)) << "far";
  EXPECT_THAT(rms_error({.square_px = 14, .blur_px = 1.3}, 0.2), Lt(0.06)) << "far and blurred";
  EXPECT_THAT(rms_error({.square_px = 35, .blur_px = 2.5}, 0.5), Lt(0.05)) << "out of focus";
  EXPECT_THAT(rms_error({.noise = 10}, 0.3), Lt(0.08)) << "dark";
}

TEST(SaddleFit, leaves_points_that_are_no_corners_where_they_are) {
  cv::Mat grey(kSize, CV_8U, cv::Scalar(200));
  grey(cv::Rect(0, 0, 320, 480)) = 40;  // an edge
  cv::circle(grey, {500, 240}, 20, 40, cv::FILLED);
  const std::vector<cv::Point2f> places = {{100, 100}, {319.5F, 200}, {500, 240}, {0, 0}};
  std::vector<cv::Point2f> points = places;
  refine_saddles(grey, std::vector<float>(places.size(), 30), kChessSaddles, points);
  EXPECT_EQ(points, places);
}

TEST(SaddleFit, does_not_move_a_point_to_another_corner) {
  std::mt19937 random(1);
  const Picture picture = draw({.noise = 0}, random);
  // Halfway between two corners.
  std::vector<cv::Point2f> points = {(picture.corners[0] + picture.corners[1]) / 2};
  refine_saddles(picture.grey, std::vector<float>{picture.spacings[0]}, kChessSaddles, points);
  EXPECT_THAT(cv::norm(points[0] - (picture.corners[0] + picture.corners[1]) / 2),
              Lt(0.15 * picture.spacings[0]));
}

TEST(SaddleFit, works_at_the_border_of_the_image) {
  std::mt19937 random(1);
  const Picture picture = draw({.noise = 1}, random);
  const cv::Point2f corner = picture.corners[0];
  const cv::Rect box(cvFloor(corner.x) - 6, cvFloor(corner.y) - 6, 200, 200);
  std::vector<cv::Point2f> points = {corner - cv::Point2f(box.tl()) + cv::Point2f(0.3F, 0.3F)};
  refine_saddles(picture.grey(box).clone(), std::vector<float>{picture.spacings[0]}, kChessSaddles,
                 points);
  EXPECT_THAT(cv::norm(points[0] + cv::Point2f(box.tl()) - corner), Lt(0.2));
}

}  // namespace
}  // namespace v3d::calib
