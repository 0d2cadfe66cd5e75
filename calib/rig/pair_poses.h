// How two cameras stand to each other, from the boards that both see at the same instant.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "base/camera_model.h"
#include "calib/boards/board.h"
#include "calib/boards/board_pose.h"

namespace v3d::calib {

/// By instant, all the poses that a observation allows: the board may lean either way, and one that
/// looks the same when turned may be turned.
using CameraPoses = std::map<int64_t, std::vector<RigidTransform>>;
CameraPoses possible_poses(const CameraModel& lens, const Board& board,
                           const CameraObservations& camera);

struct PairPose {
  int a = 0, b = 0;  ///< cameras, a < b
  RigidTransform b_from_a;
  int shared = 0;    ///< instants at which both see the board
  int agreeing = 0;  ///< of these, those that tell of this pose within a few degrees and per cent
  double spread_m = 0;  ///< median distance by which the agreeing ones differ from it
};

/// The pose that most shared instants agree on. `b_is_late`: the picture of b at instant n + that
/// belongs to the one of a at n. No shared instant: shared is 0.
PairPose pair_pose(const CameraPoses& a, const CameraPoses& b, int64_t b_is_late = 0);

/// Of all pairs that share at least one instant.
std::vector<PairPose> pair_poses(const std::vector<CameraPoses>& cameras);

/// The pairs that connect the cameras best: a maximum spanning tree by the number of agreeing
/// instants (Prim), from the camera with the most. Pairs with fewer than kFewestAgreeing do not
/// connect. In the order of growth; fewer than cameras - 1 where the rig falls apart.
inline constexpr int kFewestAgreeing = 3;
struct TreeEdge {
  int from = 0, to = 0;
  RigidTransform to_from_from;
  int agreeing = 0;
};
struct RigTree {
  int root = 0;
  std::vector<TreeEdge> edges{};
};
RigTree spanning_tree(int cameras, const std::vector<PairPose>& pairs);

/// Cameras in groups that the pairs connect, largest first.
std::vector<std::vector<int>> connected_groups(int cameras, const std::vector<PairPose>& pairs);

}  // namespace v3d::calib
