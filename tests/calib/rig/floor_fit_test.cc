#include "calib/rig/floor_fit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "calib/board_walk_observations.h"
#include "calib/boards/board_pose.h"
#include "sim/scene.h"
#include "support/message_of.h"

namespace v3d::calib {
namespace {

using testing::HasSubstr;

class Floor : public testing::Test {
 protected:
  /// The board lies on z = 0 with its first corner at the origin, x along the columns.
  std::vector<CameraObservations> lying(const Board& board, double noise_px) const {
    std::vector<CameraObservations> cameras;
    for (const RigCamera& c : truth_) {
      CameraObservations camera{c.name, c.model.size(), {}};
      for (int n = 0; n < 5; ++n) {
        BoardObservation observation;
        for (int i = 0; i < board.corners(); ++i) {
          const auto pixel = c.model.project(board.corner(i));
          if (!pixel || !c.model.inside_image(*pixel)) continue;
          const double angle = 2.4 * (7 * i + n);
          observation.corners.push_back(i);
          observation.pixels.push_back(
              *pixel + noise_px * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
        }
        if (observation.count() == board.corners()) camera.observations[n] = observation;
      }
      cameras.push_back(camera);
    }
    return cameras;
  }

  static void expect_same_places(const Rig& found, const Rig& truth, double metres) {
    for (size_t i = 0; i < truth.size(); ++i) {
      EXPECT_LT((found[i].model.center() - truth[i].model.center()).norm(), metres);
    }
  }

  Board board_ = parse_board("chess:9x6:80mm");
  Rig truth_ = sim::make_rig(12, {1024, 768}, 3);
  Similarity elsewhere_{1, RigidTransform::from_rodrigues({0.4, -1.1, 0.3}, {0.5, 2, -1})};
};

TEST_F(Floor, becomes_the_world_to_a_millimetre) {
  const FloorFit fit = fit_floor(moved_rig(truth_, elsewhere_), board_, lying(board_, 0.2));
  EXPECT_FALSE(fit.scaled);
  EXPECT_NEAR(fit.board_by_rig, 1, 0.001);
  EXPECT_NEAR(fit.rms_px, 0.1, 0.1);
  EXPECT_LT(fit.disagreement_deg, 0.5);
  expect_same_places(fit.rig, truth_, 0.004);
}

TEST_F(Floor, gives_a_rig_of_another_scale_its_metres) {
  elsewhere_.scale = 0.5;
  const FloorFit fit = fit_floor(moved_rig(truth_, elsewhere_), board_, lying(board_, 0));
  EXPECT_TRUE(fit.scaled);
  EXPECT_NEAR(fit.board_by_rig, 2, 1e-6);
  expect_same_places(fit.rig, truth_, 1e-5);
}

TEST_F(Floor, tells_by_how_much_a_camera_sees_it_lean_otherwise_than_the_others) {
  constexpr double kDegree = 3.14159265 / 180;
  const auto cameras = lying(board_, 0);
  CameraModel& model = truth_[1].model;
  const RigidTransform lean = RigidTransform::from_rodrigues({1.5 * kDegree, 0, 0}, {0, 0, 0});
  model = with_pose(model, model.cam_from_world() * lean);
  EXPECT_NEAR(fit_floor(truth_, board_, cameras).disagreement_deg, 1.5, 0.05);
}

TEST_F(Floor, of_a_board_that_looks_the_same_when_turned_is_at_one_end_for_all_cameras) {
  const Board even = parse_board("chess:8x6:80mm");
  auto cameras = lying(even, 0);
  for (size_t i = 1; i < cameras.size(); i += 2) {
    for (auto& [instant, observation] : cameras[i].observations)
      observation = half_turned(even, observation);
  }
  const FloorFit fit = fit_floor(moved_rig(truth_, elsewhere_), even, cameras);
  EXPECT_LT(fit.rms_px, 1e-3);
}

TEST_F(Floor, is_refused_where_one_camera_alone_sees_it_or_it_fits_no_rig) {
  auto cameras = lying(board_, 0);
  auto one = cameras;
  for (size_t i = 1; i < one.size(); ++i) one[i].observations.clear();
  EXPECT_THAT(test::message_of<InputError>([&] { fit_floor(truth_, board_, one); }),
              HasSubstr("too few boards"));
  std::swap(cameras[0].observations, cameras[1].observations);
  EXPECT_THAT(test::message_of<InputError>([&] { fit_floor(truth_, board_, cameras); }),
              HasSubstr("does not fit the calibration"));
}

}  // namespace
}  // namespace v3d::calib
