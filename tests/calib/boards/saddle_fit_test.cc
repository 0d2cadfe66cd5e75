#include "calib/boards/saddle_fit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <random>

#include "support/drawn_board.h"

namespace v3d::calib {
namespace {

using testing::Lt;

/// RMS error of the refined corners, pixels, when detection is off by `start_px` in each
/// coordinate.
double rms_error(const test::BoardView& view, double start_px) {
  std::mt19937 random(1);
  const test::BoardPicture picture = test::drawn_board(view, random);
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
  cv::Mat grey(480, 640, CV_8U, cv::Scalar(200));
  grey(cv::Rect(0, 0, 320, 480)) = 40;  // an edge
  cv::circle(grey, {500, 240}, 20, 40, cv::FILLED);
  const std::vector<cv::Point2f> places = {{100, 100}, {319.5F, 200}, {500, 240}, {0, 0}};
  std::vector<cv::Point2f> points = places;
  refine_saddles(grey, std::vector<float>(places.size(), 30), kChessSaddles, points);
  EXPECT_EQ(points, places);
}

TEST(SaddleFit, does_not_move_a_point_to_another_corner) {
  std::mt19937 random(1);
  const test::BoardPicture picture = test::drawn_board({.noise = 0}, random);
  // Halfway between two corners.
  std::vector<cv::Point2f> points = {(picture.corners[0] + picture.corners[1]) / 2};
  refine_saddles(picture.grey, std::vector<float>{picture.spacings[0]}, kChessSaddles, points);
  EXPECT_THAT(cv::norm(points[0] - (picture.corners[0] + picture.corners[1]) / 2),
              Lt(0.15 * picture.spacings[0]));
}

TEST(SaddleFit, works_at_the_border_of_the_image) {
  std::mt19937 random(1);
  const test::BoardPicture picture = test::drawn_board({.noise = 1}, random);
  const cv::Point2f corner = picture.corners[0];
  const cv::Rect box(cvFloor(corner.x) - 6, cvFloor(corner.y) - 6, 200, 200);
  std::vector<cv::Point2f> points = {corner - cv::Point2f(box.tl()) + cv::Point2f(0.3F, 0.3F)};
  refine_saddles(picture.grey(box).clone(), std::vector<float>{picture.spacings[0]}, kChessSaddles,
                 points);
  EXPECT_THAT(cv::norm(points[0] + cv::Point2f(box.tl()) - corner), Lt(0.2));
}

}  // namespace
}  // namespace v3d::calib
