// Pulses that nothing records: for v3dctl check, and for previews of an idle studio.
#pragma once

#include <functional>

#include "daemon/operator_client.h"

namespace v3d::ctl {

struct Rehearsal {
  int64_t pulses = 100;
  double rate_hz = 0;  ///< 0: as the studio file says
};

/// Has every node look at `pulses` pulses and gives what they say of them. It is armed and started
/// as a take is, so that the cameras of all nodes see every pulse. `meanwhile` is called often.
/// Throws std::runtime_error, with what the nodes said, when they refuse or fall silent, and when
/// the person interrupts it; nothing is armed after that.
Answer rehearse(OperatorClient& client, const Studio& studio, const Rehearsal& rehearsal,
                const std::function<void()>& meanwhile);

}  // namespace v3d::ctl
