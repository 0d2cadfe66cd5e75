// Where the board was at the instants that tell most of a rig whose cameras have first places.
#pragma once

#include <cstdint>
#include <vector>

#include "calib/lens/bundle_adjustment.h"
#include "calib/rig/pair_poses.h"

namespace v3d::calib {

struct PlacedBoards {
  Bundle bundle;                  ///< the cameras, and the boards with all that was seen of them
  std::vector<int64_t> instants;  ///< of the bundle's boards, rising
};

struct BoardPlaces {
  const Board& board;
  const std::vector<CameraObservations>& seen;  ///< by camera, as all here
  const std::vector<CameraPoses>& poses;        ///< that the observations allow
  const std::vector<PairPose>& pairs;           ///< what cameras share
};

/// Takes the `most` instants that tell most, those first that connect cameras which share little.
/// Each board gets the pose, of all that its observations allow, with which they agree best;
/// observations of a board that looks the same when turned are turned so that they say the same. An
/// instant that one camera alone saw tells nothing.
PlacedBoards place_boards(const BoardPlaces& from, std::vector<CameraModel> cameras, int most);

}  // namespace v3d::calib
