#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/core/error.h"
#include "calib/board_walk_observations.h"
#include "calib/boards/board.h"
#include "calib/rig/rig_alignment.h"
#include "sim/rendering/scene.h"
#include "support/message_of.h"

namespace v3d::calib {
namespace {

using testing::HasSubstr;

class FloorFitting : public testing::Test {
 protected:
  /// Observations of a board on z = 0 with its first corner at the origin, x along the columns.
  std::vector<CameraObservations> observe(const Board& board, double noise_px) const {
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

  static void expect_same_positions(const Rig& found, const Rig& truth, double metres) {
    for (size_t i = 0; i < truth.size(); ++i) {
      EXPECT_LT((found[i].model.center() - truth[i].model.center()).norm(), metres);
    }
  }

  Board board_ = parse_board("chess:9x6:80mm");
  Rig truth_ = sim::make_rig(12, {1024, 768}, 3);
  Similarity rig_from_world_{1, RigidTransform::from_rodrigues({0.4, -1.1, 0.3}, {0.5, 2, -1})};
};

TEST_F(FloorFitting, recovers_the_world_frame_within_millimetres) {
  const FloorFit fit =
      fit_floor(transformed_rig(truth_, rig_from_world_), board_, observe(board_, 0.2));
  EXPECT_FALSE(fit.scaled);
  EXPECT_NEAR(fit.board_by_rig, 1, 0.001);
  EXPECT_NEAR(fit.rms_px, 0.1, 0.1);
  EXPECT_LT(fit.disagreement_deg, 0.5);
  expect_same_positions(fit.rig, truth_, 0.004);
}

TEST_F(FloorFitting, corrects_the_scale_of_the_rig) {
  rig_from_world_.scale = 0.5;
  const FloorFit fit =
      fit_floor(transformed_rig(truth_, rig_from_world_), board_, observe(board_, 0));
  EXPECT_TRUE(fit.scaled);
  EXPECT_NEAR(fit.board_by_rig, 2, 1e-6);
  expect_same_positions(fit.rig, truth_, 1e-5);
}

TEST_F(FloorFitting, reports_the_largest_angle_between_observed_board_normals) {
  constexpr double kDegree = 3.14159265 / 180;
  const auto cameras = observe(board_, 0);
  CameraModel& model = truth_[1].model;
  const RigidTransform tilt = RigidTransform::from_rodrigues({1.5 * kDegree, 0, 0}, {0, 0, 0});
  model = with_pose(model, model.cam_from_world() * tilt);
  EXPECT_NEAR(fit_floor(truth_, board_, cameras).disagreement_deg, 1.5, 0.05);
}

TEST_F(FloorFitting, resolves_the_half_turn_symmetry_of_a_board) {
  const Board even = parse_board("chess:8x6:80mm");
  auto cameras = observe(even, 0);
  for (size_t i = 1; i < cameras.size(); i += 2) {
    for (auto& [instant, observation] : cameras[i].observations)
      observation = half_turned(even, observation);
  }
  const FloorFit fit = fit_floor(transformed_rig(truth_, rig_from_world_), even, cameras);
  EXPECT_LT(fit.rms_px, 1e-3);
}

TEST_F(FloorFitting, rejects_a_single_camera_and_a_board_that_does_not_fit) {
  auto cameras = observe(board_, 0);
  auto one = cameras;
  for (size_t i = 1; i < one.size(); ++i) one[i].observations.clear();
  EXPECT_THAT(test::message_of<InputError>([&] { fit_floor(truth_, board_, one); }),
              HasSubstr("too few boards"));
  std::swap(cameras[0].observations, cameras[1].observations);
  EXPECT_THAT(test::message_of<InputError>([&] { fit_floor(truth_, board_, cameras); }),
              HasSubstr("does not fit the calibration"));
}

TEST(FloorWeaknesses, are_cameras_that_disagree_by_more_than_a_degree) {
  FloorFit fit;
  fit.disagreement_deg = 0.5;
  EXPECT_THAT(find_weaknesses(fit), testing::IsEmpty());
  fit.disagreement_deg = 2;
  EXPECT_THAT(find_weaknesses(fit), testing::ElementsAre(HasSubstr("2.0 degrees apart")));
}

}  // namespace
}  // namespace v3d::calib
