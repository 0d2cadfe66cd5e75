// A take to mesh.v3d, with figures about the result.
#pragma once

#include "v3dctl/reconstruct/reconstruct_report.h"
#include "v3dctl/reconstruct/reconstruct_request.h"

namespace v3d::ctl {

/// Replaces the take's mesh.v3d when all frames are done. Throws InputError for bad input; the old
/// mesh.v3d then stays.
ReconstructReport reconstruct_take(const ReconstructRequest& request);

}  // namespace v3d::ctl
