// The lenses of a rig's cameras, before it is known where they stand.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/camera_model.h"
#include "calib/boards/board.h"
#include "calib/rig/pair_poses.h"

namespace v3d::calib {

struct RigLenses {
  std::vector<CameraModel> lenses;  ///< at the origin
  std::vector<int> coefficients;    ///< that were fitted; 0: the lens was known
};

/// Fits each camera's own (lens_fit.h), or takes all over from `before`. Throws InputError where a
/// camera has too few views, is not in `before` or was of another size then, and where two cameras'
/// pictures fit each other's lens. On so many threads.
RigLenses find_rig_lenses(const Board& board, const std::vector<CameraSightings>& cameras,
                          const std::optional<Rig>& before, int threads);

/// Throws InputError: "swapped cameras: a and b: WHY the other: ...".
[[noreturn]] void refuse_swapped(const std::string& a, const std::string& b,
                                 const std::string& why);

}  // namespace v3d::calib
