#include "calib/lens/bundle_adjustment.h"

#include <gtest/gtest.h>

#include "calib/board_walk_observations.h"
#include "calib/boards/board.h"
#include "sim/rendering/scene.h"

namespace v3d::calib {
namespace {

/// Observations of some boards, with the true parameters and with a start that is off by
/// centimetres.
struct Case {
  Bundle truth;
  Bundle start;
};

Case make_case(const Distortion& distortion) {
  const Board board = parse_board("chess:9x6:80mm");
  Rig rig = sim::make_rig(5, {1024, 768}, 2);
  for (RigCamera& c : rig) {
    Eigen::Matrix3d k = c.model.matrix();
    k(0, 1) = 0.7;  // skew
    c.model = CameraModel(c.model.size(), k, distortion, c.model.cam_from_world());
  }
  std::vector<Eigen::Vector3d> corners;
  for (int i = 0; i < board.corners(); ++i) corners.push_back(board.corner(i));
  const sim::BoardWalk walk = sim::walk_board(rig, corners, {60, 0, 4});
  Case c;
  c.truth.board = board;
  for (const RigCamera& camera : rig) c.truth.cameras.push_back(camera.model);
  c.truth.world_from_board = walk.world_from_board;
  std::vector<bool> seen(walk.world_from_board.size(), false);
  for (const sim::ObservedCorner& s : walk.corners) {
    c.truth.observations.push_back({s.camera, s.board, s.corner, s.pixel});
    seen[s.board] = true;
  }
  for (size_t i = 0; i < seen.size(); ++i) {  // an unobserved board has no pose
    if (!seen[i]) {
      c.truth.world_from_board[i] = c.truth.world_from_board[0];
      c.truth.observations.push_back(c.truth.observations[0]);
      c.truth.observations.back().board = static_cast<int>(i);
    }
  }
  c.start = c.truth;
  for (size_t i = 1; i < c.start.cameras.size(); ++i) {
    RigidTransform pose = c.start.cameras[i].cam_from_world();
    pose.translation += Eigen::Vector3d(0.03, -0.02, 0.04);
    c.start.cameras[i] = with_pose(c.start.cameras[i], pose);
  }
  for (RigidTransform& pose : c.start.world_from_board) pose.translation.y() += 0.02;
  return c;
}

double worst_residual(const Bundle& bundle) {
  double worst = 0;
  for (const auto& residual : residuals(bundle)) worst = std::max(worst, residual.norm());
  return worst;
}

TEST(BundleAdjustment, recovers_poses_and_lenses_from_corners_without_noise) {
  Case c = make_case({-0.2, 0.05, 0.001, -0.0005, 0.01});
  ASSERT_LT(worst_residual(c.truth), 1e-6);
  ASSERT_GT(worst_residual(c.start), 5);
  BundleOptions options;
  options.coefficients.assign(c.start.cameras.size(), 5);
  EXPECT_TRUE(adjust(c.start, options).converged);
  EXPECT_LT(worst_residual(c.start), 0.05);  // the effect of the weak lens prior remains
}

TEST(BundleAdjustment, uses_every_coefficient_of_the_lens_model_including_prism_and_tilt) {
  Case c = make_case({-0.2, 0.05, 0.001, -0.0005, 0.01, 0.1, 0.02, 0.001, 0.002, -0.001, 0.001,
                      0.0005, 0.02, -0.03});
  ASSERT_LT(worst_residual(c.truth), 1e-6);
  EXPECT_TRUE(adjust(c.start, {}).converged);  // lenses known
  EXPECT_LT(worst_residual(c.start), 1e-4);
  for (size_t i = 0; i < c.truth.cameras.size(); ++i) {
    EXPECT_LT((c.start.cameras[i].center() - c.truth.cameras[i].center()).norm(), 1e-6);
  }
}

TEST(BundleAdjustment, is_robust_to_a_few_outlier_corners) {
  Case c = make_case({-0.1});
  for (size_t i = 0; i < c.start.observations.size(); i += 50)
    c.start.observations[i].pixel.x() += 40;
  adjust(c.start, {});
  for (size_t i = 0; i < c.truth.cameras.size(); ++i) {
    EXPECT_LT((c.start.cameras[i].center() - c.truth.cameras[i].center()).norm(), 0.002);
  }
}

}  // namespace
}  // namespace v3d::calib
