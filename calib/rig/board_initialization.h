// Initial board poses for the bundle adjustment of a rig whose camera poses are roughly known.
#pragma once

#include <cstdint>
#include <vector>

#include "calib/lens/bundle_adjustment.h"
#include "calib/rig/pair_poses.h"

namespace v3d::calib {

struct InitialBoards {
  Bundle bundle;                  ///< cameras, boards and all observations of the boards
  std::vector<int64_t> instants;  ///< of the boards in the bundle, in ascending order
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
