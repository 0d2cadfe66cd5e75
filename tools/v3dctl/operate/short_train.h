// Short train of pulses, for `check`, `preview` in an idle studio, and `calibrate --live`.
#pragma once

#include <functional>
#include <string>

#include "daemon/control/operator_client.h"

namespace v3d::ctl {

struct ShortTrain {
  int64_t pulses = 100;
  double rate_hz = 0;  ///< 0: as in the studio file
  std::string take{};  ///< name of the take to record; empty: the nodes measure and record nothing
};

/// Arms all nodes, starts the train, waits for its end and stops. Returns the replies to the stop:
/// the measurements of the cameras, or the ledger of the take. `meanwhile`: called repeatedly, at
/// least 20 times a second. Throws std::runtime_error with the nodes' replies when a node rejects
/// an order or does not reply, and when the user interrupts. All nodes are disarmed then.
control::Answer run_train(control::OperatorClient& client, const Studio& studio,
                          const ShortTrain& train, const std::function<void()>& meanwhile);

}  // namespace v3d::ctl
