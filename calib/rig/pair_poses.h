// Relative poses of pairs of cameras, initial poses of boards.
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "base/geometry/camera_model.h"
#include "calib/boards/board.h"
#include "calib/lens/bundle_adjustment.h"

namespace v3d::calib {

// Relative poses of camera pairs, from boards that both cameras observe, and the graph of pairs.

/// By instant, all poses cam_from_board that an observation allows: the tilt of a board may be
/// ambiguous, and a board with half-turn symmetry may be turned.
using CandidatePoses = std::map<int64_t, std::vector<RigidTransform>>;
CandidatePoses candidate_poses(const CameraModel& lens, const Board& board,
                               const CameraObservations& camera);

/// The relative pose of two cameras.
struct PairPose {
  int a = 0, b = 0;  ///< cameras, a < b
  RigidTransform b_from_a;
  int shared = 0;       ///< instants at which both cameras observe the board
  int inliers = 0;      ///< shared instants whose board poses agree within 4 degrees and 5 %
  double spread_m = 0;  ///< median distance of the inliers' translations from that of b_from_a
};

/// The relative pose with most inliers. `b_offset`: the observation of b at instant n + b_offset
/// belongs to the observation of a at instant n. Where no instant is shared, `shared` is 0.
PairPose pair_pose(const CandidatePoses& a, const CandidatePoses& b, int64_t b_offset = 0);

/// The relative poses of all pairs that share at least one instant.
std::vector<PairPose> pair_poses(const std::vector<CandidatePoses>& cameras);

/// Pairs with fewer inliers do not connect cameras.
inline constexpr int kMinInliers = 3;

struct TreeEdge {
  int from = 0, to = 0;
  RigidTransform to_from_from;
  int inliers = 0;
};
struct RigTree {
  int root = 0;
  std::vector<TreeEdge> edges{};
};

/// A maximum spanning tree by the number of inliers (Prim), from the camera with most inliers.
/// Edges are in the order of growth. There are fewer than cameras - 1 where the graph is not
/// connected.
RigTree spanning_tree(int cameras, const std::vector<PairPose>& pairs);

/// The connected components of the graph, largest first.
std::vector<std::vector<int>> connected_components(int cameras, const std::vector<PairPose>& pairs);

// Initial board poses for the bundle adjustment of a rig whose camera poses are roughly known.

struct InitialBoards {
  Bundle bundle;                  ///< cameras, boards and all observations of the boards
  std::vector<int64_t> instants;  ///< of the boards in the bundle, in ascending order
  /// Camera and instant of the observations that are half_turned() in the bundle.
  std::set<std::pair<int, int64_t>> turned{};
};

struct BoardInitialization {
  const Board& board;
  const std::vector<CameraObservations>& observations;  ///< by camera
  const std::vector<CandidatePoses>& poses;             ///< by camera
  const std::vector<PairPose>& pairs;
};

/// Selects at most `max_instants` instants and gives each board its best candidate pose.
///
/// Instants that connect pairs with few shared views are preferred. An instant that only one camera
/// observed is not used. The best candidate has the smallest sum of (bounded) reprojection errors.
/// Observations of a board with half-turn symmetry are turned so that they agree.
InitialBoards initialize_boards(const BoardInitialization& input, std::vector<CameraModel> cameras,
                                int max_instants);

}  // namespace v3d::calib
