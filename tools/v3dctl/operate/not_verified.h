// For commands that look on without the studio key.
#pragma once

#include "common/console.h"
#include "daemon/operator_client.h"

namespace v3d::ctl {

/// One line on stderr when anybody may have said what the client shows.
inline void tell_if_not_verified(const OperatorClient& client) {
  if (client.not_verified().empty()) return;
  note("v3dctl: not verified, anybody may have said it: " + client.not_verified());
}

}  // namespace v3d::ctl
