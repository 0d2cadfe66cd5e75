// Some pulses and no more: for v3dctl check, for previews of an idle studio, and for the short
// takes that calibrate --live records.
#pragma once

#include <functional>
#include <string>

#include "daemon/operator_client.h"

namespace v3d::ctl {

struct PulseTrain {
  int64_t pulses = 100;
  double rate_hz = 0;  ///< 0: as the studio file says
  std::string take{};  ///< recorded under this name; empty: looked at, and nothing is recorded
};

/// Has every node see the pulses and gives what they say of them: of a take, its ledger. It is
/// armed and started as every take is, so that the cameras of all nodes see every pulse.
/// `meanwhile` is called often. Throws std::runtime_error, with what the nodes said, when they
/// refuse or fall silent, and when the person interrupts it; nothing is armed after that.
Answer run_train(OperatorClient& client, const Studio& studio, const PulseTrain& train,
                 const std::function<void()>& meanwhile);

}  // namespace v3d::ctl
