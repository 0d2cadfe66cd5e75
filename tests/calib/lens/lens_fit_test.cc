#include "calib/lens/lens_fit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "base/core/error.h"
#include "calib/board_walk_observations.h"
#include "sim/rendering/scene.h"
#include "support/message_of.h"

namespace v3d::calib {
namespace {

using testing::HasSubstr;

class LensFitting : public testing::Test {
 protected:
  std::vector<LensView> views_of(const CameraModel& camera, int boards, double noise_px = 0.2,
                                 uint64_t seed = 5) {
    const auto seen = observe_board_walk(board_, {{"cam", camera}}, {boards, noise_px, seed});
    std::vector<LensView> views;
    for (const auto& [instant, observation] : seen[0].observations) {
      views.push_back({"frame " + std::to_string(instant), observation});
    }
    return views;
  }

  /// Boards parallel to the image, at several places and distances.
  std::vector<LensView> frontal_views_of(const CameraModel& camera) {
    std::mt19937 random(1);
    std::normal_distribution<double> noise(0, 0.05);
    const RigidTransform world_from_cam = camera.cam_from_world().inverse();
    std::vector<LensView> views;
    for (int n = 0; n < 12; ++n) {
      const double z = (10 + n) * board_.square_m;
      const Eigen::Vector3d place(0.15 * z * (n % 4 - 1.5), 0.15 * z * (n % 3 - 1), z);
      LensView view{"frame " + std::to_string(n), {}};
      for (int i = 0; i < board_.corners(); ++i) {
        const Eigen::Vector3d corner = place + board_.corner(i) - board_.centre();
        view.observation.corners.push_back(i);
        view.observation.pixels.push_back(*camera.project(world_from_cam * corner) +
                                          Eigen::Vector2d(noise(random), noise(random)));
      }
      views.push_back(view);
    }
    return views;
  }

  /// The largest error of a pixel over the image, for the same camera axes.
  static double worst_ray_error_px(const CameraModel& found, const CameraModel& truth) {
    const CameraModel a(found.size(), found.matrix(), found.distortion(), {});
    const CameraModel b(truth.size(), truth.matrix(), truth.distortion(), {});
    double worst = 0;
    for (int y = 100; y < 700; y += 100) {
      for (int x = 100; x < 1000; x += 100) {
        const auto ray = b.ray(Eigen::Vector2d(x, y));
        const auto pixel = a.project(*ray);
        worst = std::max(worst, (*pixel - Eigen::Vector2d(x, y)).norm());
      }
    }
    return worst;
  }

  Board board_ = parse_board("chess:9x6:80mm");
  Rig rig_ = sim::make_rig(8, {1024, 768}, 3);
};

TEST_F(LensFitting, recovers_the_lens_from_noisy_corners) {
  const CameraModel& truth = rig_[0].model;
  const auto views = views_of(truth, 300);
  const LensFit fit = fit_lens("cam", board_, truth.size(), views, {});
  EXPECT_NEAR(fit.rms_px, 0.2 * std::sqrt(2.0), 0.02);
  EXPECT_NEAR(fit.lens.matrix()(0, 0), truth.matrix()(0, 0), 1.5);
  EXPECT_LT(worst_ray_error_px(fit.lens, truth), 3.0);
  EXPECT_TRUE(fit.rejected.empty());
  EXPECT_LE(std::ssize(fit.fitted), 40);
}

TEST_F(LensFitting, selects_the_fewest_coefficients_that_predict_equally_well) {
  const CameraModel& simple = rig_[0].model;
  EXPECT_LE(fit_lens("cam", board_, simple.size(), views_of(simple, 300), {}).coefficients, 5);

  // The distortion of a wide lens is rational; a polynomial does not fit it near the border.
  Distortion strong{};
  strong[0] = 0.4;  // k1
  strong[5] = 1.2;  // k4
  Eigen::Matrix3d k = simple.matrix();
  k(0, 0) = k(1, 1) = 700;
  const CameraModel wide(simple.size(), k, strong, simple.cam_from_world());
  const LensFit fit = fit_lens("cam", board_, wide.size(), views_of(wide, 400, 0.02), {});
  EXPECT_EQ(fit.coefficients, 8);
  ASSERT_EQ(fit.trials.size(), 3U);
  EXPECT_GT(fit.trials[0].held_out_rms_px, 1.05 * fit.trials[2].held_out_rms_px);
}

TEST_F(LensFitting, rejects_an_outlier_view_and_reports_the_reason) {
  const CameraModel& truth = rig_[0].model;
  auto views = views_of(truth, 300);
  const size_t bad = views.size() / 2;
  for (size_t i = 0; i < views[bad].observation.pixels.size(); i += 3) {
    views[bad].observation.pixels[i].x() += 5;
  }
  LensOptions options;
  options.max_views = 1000;
  const LensFit fit = fit_lens("cam", board_, truth.size(), views, options);
  ASSERT_EQ(fit.rejected.size(), 1U);
  EXPECT_EQ(fit.rejected[0].view, static_cast<int>(bad));
  EXPECT_THAT(fit.rejected[0].reason, HasSubstr("its RMS residual is"));
  EXPECT_NEAR(fit.rms_px, 0.28, 0.03);
}

TEST_F(LensFitting, reports_views_without_a_pose_of_the_board) {
  const CameraModel& truth = rig_[0].model;
  auto views = views_of(truth, 300);
  views.resize(12);
  for (const size_t one_row : {2U, 7U}) {
    views[one_row].observation.corners.resize(board_.corner_columns);
    views[one_row].observation.pixels.resize(board_.corner_columns);
  }
  const LensFit fit = fit_lens("cam07", board_, truth.size(), views, {});
  EXPECT_EQ(fit.fitted.size() + fit.rejected.size() + fit.unneeded, views.size());
  ASSERT_EQ(fit.rejected.size(), 2U);
  EXPECT_EQ(fit.rejected[0].view, 2);
  EXPECT_EQ(fit.rejected[1].view, 7);
  EXPECT_THAT(fit.rejected[0].reason, HasSubstr("no pose of the board"));
  views.erase(views.begin() + 8, views.end());
  views.erase(views.begin(), views.begin() + 2);
  EXPECT_THAT(
      test::message_of<InputError>([&] { fit_lens("cam07", board_, truth.size(), views, {}); }),
      HasSubstr("cam07: too few boards: 4 usable images of the 6 with a detected board"));
}

TEST_F(LensFitting, rejects_boards_that_are_all_parallel_to_the_image) {
  const CameraModel& any = rig_[0].model;
  const CameraModel straight(any.size(), any.matrix(), {}, any.cam_from_world());
  const auto views = frontal_views_of(straight);
  EXPECT_THAT(
      test::message_of<InputError>([&] { fit_lens("cam07", board_, any.size(), views, {}); }),
      testing::AllOf(HasSubstr("cam07: the boards do not determine the focal length"),
                     HasSubstr("tilt the board by 30 degrees")));
}

TEST_F(LensFitting, states_the_standard_deviation_of_the_focal_length) {
  constexpr int kTrials = 12;
  const CameraModel& truth = rig_[0].model;
  double squares = 0;
  for (uint64_t seed = 1; seed <= kTrials; ++seed) {
    const auto views = views_of(truth, 100, 0.2, seed);
    const LensFit fit = fit_lens("cam", board_, truth.size(), views, {.max_views = 15});
    const double error = fit.lens.matrix()(0, 0) - truth.matrix()(0, 0);
    EXPECT_LT(std::abs(error), 3.5 * fit.focal_deviation_px) << seed;
    squares += std::pow(error / fit.focal_deviation_px, 2) / kTrials;
  }
  // 1 but for chance.
  EXPECT_GT(std::sqrt(squares), 0.5);
  EXPECT_LT(std::sqrt(squares), 1.7);
}

TEST_F(LensFitting, has_a_weakness_where_residuals_are_large_or_boards_hardly_tilted) {
  LensFit fit;
  fit.lens = rig_[0].model;
  fit.rms_px = 0.9;
  fit.focal_deviation_px = 0.009 * fit.lens.matrix()(0, 0);
  EXPECT_THAT(find_weaknesses("cam07", fit), testing::IsEmpty());
  fit.rms_px = 2.3;
  fit.focal_deviation_px = 0.02 * fit.lens.matrix()(0, 0);
  EXPECT_THAT(find_weaknesses("cam07", fit),
              testing::ElementsAre(HasSubstr("cam07 has an RMS residual of 2.3 px"),
                                   HasSubstr("tilt the board by 30 degrees")));
}

TEST_F(LensFitting, names_the_camera_with_too_few_boards) {
  const CameraModel& truth = rig_[0].model;
  auto views = views_of(truth, 300);
  views.resize(3);
  EXPECT_THAT(
      test::message_of<InputError>([&] { fit_lens("cam07", board_, truth.size(), views, {}); }),
      HasSubstr("cam07: too few boards: 3 usable images, at least 5 are needed"));
  EXPECT_THAT(
      test::message_of<InputError>([&] { fit_lens("cam07", board_, truth.size(), {}, {}); }),
      HasSubstr("too few boards"));
}

}  // namespace
}  // namespace v3d::calib
