#include <gtest/gtest.h>

#include "recon/metrics/evaluation.h"
#include "recon/shapes.h"

namespace v3d::recon {
namespace {

constexpr ImageSize kSize{400, 300};

const Mesh& ball() {
  static const Mesh kBall = shapes::sphere({0, 0, 0}, 0.5F, 48);
  return kBall;
}

/// Visible part of the ball from 20 m: normals within acos(0.2 + 0.5 / 20) of the direction to the
/// camera.
constexpr double kSeen = (1 - 0.225) / 2;

CameraModel looking_from(const Eigen::Vector3d& way) {
  return shapes::camera(20 * way, {0, 0, 0}, kSize, 3500);
}

TEST(VisibilityReportTest, counts_the_cameras_that_a_true_place_faces) {
  const std::vector<CameraModel> cameras = {looking_from({1, 0, 0}), looking_from({1, 0.001, 0}),
                                            looking_from({-1, 0, 0})};
  const VisibilityReport report = compare_by_visibility(ball(), ball(), cameras, 0.005);
  EXPECT_NEAR(report.seen_by[0].truth, 1 - 2 * kSeen, 0.01);
  EXPECT_NEAR(report.seen_by[1].truth, kSeen, 0.01);
  EXPECT_NEAR(report.seen_by[2].truth, kSeen, 0.01);
  EXPECT_EQ(report.seen_by[3].truth, 0);
  for (const VisibilityFigures& f : report.seen_by) EXPECT_NEAR(f.reconstructed, f.truth, 1e-9);
  EXPECT_DOUBLE_EQ(report.f_score_if_right_from(2), 1);
}

TEST(VisibilityReportTest, counts_no_camera_behind_an_occluder) {
  Mesh truth = ball();
  shapes::append(truth, shapes::sphere({3, 0, 0}, 0.7F, 48));
  const std::vector<CameraModel> cameras = {looking_from({1, 0, 0})};
  const VisibilityReport report = compare_by_visibility(truth, truth, cameras, 0.005);
  const double share_of_larger = 0.49 / (0.49 + 0.25);
  EXPECT_NEAR(report.seen_by[1].truth, kSeen * share_of_larger, 0.01);
}

TEST(VisibilityReportTest, reports_the_best_possible_f_score_of_visible_parts) {
  // One of two equal balls is missing; two cameras see a part of it.
  Mesh truth = ball();
  shapes::append(truth, shapes::sphere({0, 5, 0}, 0.5F, 48));
  const std::vector<CameraModel> cameras = {shapes::camera({20, 5, 0}, {0, 5, 0}, kSize, 3500),
                                            shapes::camera({20, 5.01, 0}, {0, 5, 0}, kSize, 3500)};
  const VisibilityReport report = compare_by_visibility(ball(), truth, cameras, 0.005);
  EXPECT_NEAR(report.seen_by[0].truth, 1 - kSeen / 2, 0.01);
  EXPECT_NEAR(report.seen_by[0].truth_within, 0.5 / (1 - kSeen / 2), 0.01);
  EXPECT_NEAR(report.seen_by[2].truth, kSeen / 2, 0.01);
  EXPECT_EQ(report.seen_by[2].truth_within, 0);
  EXPECT_NEAR(report.f_score_if_right_from(4), 2 * 0.5 / 1.5, 0.01) << "as it is";
  const double recall = 0.5 + kSeen / 2;
  EXPECT_NEAR(report.f_score_if_right_from(2), 2 * recall / (1 + recall), 0.01);
}

TEST(VisibilityReportTest, of_an_empty_mesh_divides_the_truth_alone) {
  const std::vector<CameraModel> cameras = {looking_from({1, 0, 0})};
  const VisibilityReport report = compare_by_visibility({}, ball(), cameras, 0.005);
  EXPECT_EQ(report.f_score_if_right_from(0), 0);
  EXPECT_NEAR(report.seen_by[0].truth, 1 - kSeen, 0.01);
  EXPECT_NEAR(report.seen_by[1].truth, kSeen, 0.01);
  for (const VisibilityFigures& f : report.seen_by) {
    EXPECT_EQ(f.truth_within, 0);
    EXPECT_EQ(f.reconstructed, 0);
  }
}

}  // namespace
}  // namespace v3d::recon
