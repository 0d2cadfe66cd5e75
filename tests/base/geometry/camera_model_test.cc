#include "base/geometry/camera_model.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <opencv2/calib3d.hpp>

namespace v3d {
namespace {

double real(double low, double high) {
  return low + (high - low) * *rc::gen::inRange(0, 1'000'001) / 1e6;
}

/// Distortion with the first `coefficients` (0 to 14) of OpenCV's, each within the range of real
/// lenses.
Distortion random_distortion(int coefficients) {
  constexpr std::array<double, 14> kMaxCoefficients = {0.4,  0.2,  0.005, 0.005, 0.1,  0.3,  0.1,
                                                       0.05, 0.01, 0.01,  0.01,  0.01, 0.05, 0.05};
  Distortion d{};
  for (int i = 0; i < coefficients; ++i) {
    d[i] = real(-kMaxCoefficients[i], kMaxCoefficients[i]);
  }
  return d;
}

CameraModel random_camera() {
  constexpr std::array<int, 6> kCounts = {0, 4, 5, 8, 12, 14};
  Eigen::Matrix3d k;
  k << real(400, 1500), 0, real(400, 600), 0, real(400, 1500), real(300, 450), 0, 0, 1;
  const Eigen::Vector3d eye(real(-4, 4), real(-4, 4), real(0, 3));
  const Eigen::Vector3d target(real(-0.5, 0.5), real(-0.5, 0.5), real(0.5, 1.5));
  return {{1024, 768},
          k,
          random_distortion(kCounts[*rc::gen::inRange<size_t>(0, kCounts.size())]),
          look_at(eye, target + Eigen::Vector3d(0, 0, 1e-3))};
}

RC_GTEST_PROP(CameraModel, projects_like_opencv_for_every_length_of_distortion_vector, ()) {
  const CameraModel camera = random_camera();
  const Eigen::Vector3d world(real(-1, 1), real(-1, 1), real(0, 2));
  const auto pixel = camera.project(world);
  RC_PRE(pixel.has_value());

  const RigidTransform& t = camera.cam_from_world();
  const Eigen::Vector3d r = t.rodrigues();
  cv::Mat k(3, 3, CV_64F);
  for (int i = 0; i < 9; ++i) {
    k.at<double>(i / 3, i % 3) = camera.matrix()(i / 3, i % 3);
  }
  std::vector<cv::Point2d> projected;
  const std::vector<double> distortion(camera.distortion().begin(), camera.distortion().end());
  cv::projectPoints(
      std::vector<cv::Point3d>{{world.x(), world.y(), world.z()}}, cv::Vec3d(r.x(), r.y(), r.z()),
      cv::Vec3d(t.translation.x(), t.translation.y(), t.translation.z()), k, distortion, projected);
  RC_ASSERT((*pixel - Eigen::Vector2d(projected[0].x, projected[0].y)).norm() < 1e-6);
}

RC_GTEST_PROP(CameraModel, projects_the_ray_of_a_pixel_to_that_pixel, ()) {
  const CameraModel camera = random_camera();
  const Eigen::Vector2d pixel(real(0, 1023), real(0, 767));
  const auto ray = camera.ray(pixel);
  RC_PRE(ray.has_value());
  const auto back = camera.project(camera.center() + 2.5 * *ray);
  // Rounding can move a ray at the limit of the model beyond it.
  if (back) {
    RC_ASSERT((*back - pixel).norm() < 1e-6);
  }
}

TEST(CameraModel, applies_the_skew_that_opencv_ignores) {
  Eigen::Matrix3d k;
  k << 900, -1.5, 500, 0, 900, 380, 0, 0, 1;
  const CameraModel camera({1024, 768}, k, {}, {});
  const auto pixel = camera.project({0.1, 0.2, 1});
  ASSERT_TRUE(pixel);
  EXPECT_DOUBLE_EQ(pixel->x(), 900 * 0.1 - 1.5 * 0.2 + 500);
}

TEST(CameraModel, projects_no_point_behind_the_camera) {
  const CameraModel camera({640, 480}, Eigen::Vector3d(500, 500, 1).asDiagonal(), {}, {});
  EXPECT_TRUE(camera.project({0, 0, 1}));
  EXPECT_FALSE(camera.project({0, 0, -1}));
  EXPECT_FALSE(camera.project({0, 0, 0}));
}

TEST(CameraModel, projects_no_point_beyond_the_fold_of_the_polynomial) {
  Eigen::Matrix3d k;
  k << 490, 0, 334, 0, 493, 222, 0, 0, 1;
  const CameraModel camera({644, 486}, k, {-0.5, 0, 0, 0}, {});
  // r (1 - 0.5 r^2) grows up to r^2 = 2/3 and is 0 again at r^2 = 2.
  EXPECT_NEAR(camera.max_radius2(), 2.0 / 3, 1e-9);
  EXPECT_TRUE(camera.project({0.8, 0, 1}));
  EXPECT_FALSE(camera.project({1.4, 0, 1}))
      << "the polynomial alone projects it near the image centre";
}

TEST(CameraModel, has_no_radius_limit_when_the_polynomial_never_folds) {
  EXPECT_TRUE(
      std::isinf(CameraModel({640, 480}, Eigen::Matrix3d::Identity(), {}, {}).max_radius2()));
  const Distortion pincushion{0.1};
  EXPECT_TRUE(std::isinf(
      CameraModel({640, 480}, Eigen::Matrix3d::Identity(), pincushion, {}).max_radius2()));
}

TEST(CameraModel, reduced_by_two_projects_to_half_the_pixel_coordinates) {
  Eigen::Matrix3d k;
  k << 900, 0, 511.5, 0, 900, 383.5, 0, 0, 1;
  const CameraModel camera({1024, 768}, k, {-0.1, 0.01}, {});
  const Eigen::Vector3d point(0.2, -0.1, 1.5);
  const auto whole = camera.project(point);
  const auto half = camera.reduced(2).project(point);
  ASSERT_TRUE(whole && half);
  // Pixel (0, 0) of the small image covers (0, 0) to (1, 1) of the large one.
  EXPECT_NEAR(half->x(), (whole->x() - 0.5) / 2, 1e-9);
  EXPECT_NEAR(half->y(), (whole->y() - 0.5) / 2, 1e-9);
  EXPECT_EQ(camera.reduced(2).size(), (ImageSize{512, 384}));
}

TEST(LookAt, points_the_optical_axis_at_the_target_with_the_image_upright) {
  const RigidTransform cam = look_at({3, 0, 1}, {0, 0, 1});
  const Eigen::Vector3d target = cam * Eigen::Vector3d(0, 0, 1);
  EXPECT_NEAR(target.x(), 0, 1e-12);
  EXPECT_NEAR(target.y(), 0, 1e-12);
  EXPECT_NEAR(target.z(), 3, 1e-12);
  EXPECT_LT((cam * Eigen::Vector3d(0, 0, 2)).y(), 0) << "world up is image up (-y)";
  EXPECT_NEAR(cam.rotation.determinant(), 1, 1e-12);
}

}  // namespace
}  // namespace v3d
