// JSON of the account of a check, for the details of a reply.
#pragma once

#include <string>
#include <vector>

#include "daemon/captured/camera_check.h"
#include "take/ledger/ledger.h"

namespace v3d {

/// The account of a check (v3dctl check): pulses {commanded, sensed}, checked [{name, received,
/// missing, duplicate, suspect, clipped, dark, mean_grey, focus, plates_focus, foreground}],
/// not_ready [names].
std::string check_json(const Ledger& ledger, const std::vector<CheckedCamera>& cameras,
                       const std::vector<std::string>& not_ready);

}  // namespace v3d
