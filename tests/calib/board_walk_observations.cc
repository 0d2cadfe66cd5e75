#include "calib/board_walk_observations.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <numbers>

#include "calib/rig/rig_alignment.h"

namespace v3d::calib {

std::vector<CameraObservations> observe_board_walk(const Board& board, const Rig& rig,
                                                   const sim::BoardWalkOptions& options) {
  std::vector<Eigen::Vector3d> corners;
  for (int i = 0; i < board.corners(); ++i) corners.push_back(board.corner(i));
  std::vector<CameraObservations> cameras;
  for (const RigCamera& camera : rig) cameras.push_back({camera.name, camera.model.size(), {}});
  for (const sim::ObservedCorner& seen : sim::walk_board(rig, corners, options).corners) {
    BoardObservation& observation = cameras[seen.camera].observations[seen.board];
    observation.corners.push_back(seen.corner);
    observation.pixels.push_back(seen.pixel);
  }
  return cameras;
}

PoseErrors pose_errors(const Rig& found, const Rig& truth) {
  std::vector<Eigen::Vector3d> from, to;
  for (size_t i = 0; i < found.size(); ++i) {
    from.push_back(found[i].model.center());
    to.push_back(truth[i].model.center());
  }
  const Rig moved = transformed_rig(found, align_points(from, to, false));
  PoseErrors errors;
  for (size_t i = 0; i < moved.size(); ++i) {
    errors.distance_mm.push_back(1000 * (moved[i].model.center() - to[i]).norm());
    const Eigen::Matrix3d turn = moved[i].model.cam_from_world().rotation *
                                 truth[i].model.cam_from_world().rotation.transpose();
    errors.angle_deg.push_back(Eigen::AngleAxisd(turn).angle() * 180 / std::numbers::pi);
  }
  return errors;
}

}  // namespace v3d::calib
