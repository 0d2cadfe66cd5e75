// The parts of one take, as the nodes of a studio recorded them, put together.
#pragma once

#include <vector>

#include "take/take.h"

namespace v3d {

/// Makes `into` of the parts: the cameras and backgrounds of all, the pulses of the node that
/// sensed most of them, the meshes of part_with_meshes(), one ledger (merge()). Files are linked
/// where the file system permits it, else copied; the parts stay as they are. A part may lack
/// take.toml (a node that only reconstructs). Throws InputError when the parts are none of one
/// take, or contradict each other: another rate or calibration, a camera twice; std::runtime_error
/// when the disk refuses.
TakeInfo join_parts(const std::vector<TakePaths>& parts, const TakePaths& into);

/// Of several nodes that reconstructed it, the part whose mesh.v3d has most meshes, the first of
/// them; null where no part has one.
const TakePaths* part_with_meshes(const std::vector<TakePaths>& parts);

}  // namespace v3d
