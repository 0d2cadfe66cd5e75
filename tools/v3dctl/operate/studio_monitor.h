// Current state of a studio: health of its nodes and recent events, from the bus.
#pragma once

#include <deque>
#include <map>
#include <string>
#include <vector>

#include "base/config/studio_file.h"
#include "daemon/control/operator_client.h"
#include "wire/messages.h"

namespace v3d::ctl {

struct StudioState {
  std::string studio;
  std::vector<std::string> nodes;                           ///< in the order of the studio file
  std::map<std::string, std::vector<std::string>> cameras;  ///< names by node
  std::map<std::string, wire::HealthMessage> health;  ///< last of each node; silent nodes have none
  std::deque<wire::EventMessage> events;              ///< newest last
};

/// Receives health and events. One thread.
class StudioMonitor {
 public:
  /// Joins the network of the studio. Throws InputError when that fails.
  explicit StudioMonitor(const Studio& studio);

  /// Updates state() with the messages since the last call, and waits at most 100 ms for one.
  /// Returns the new events.
  std::vector<wire::EventMessage> poll();
  const StudioState& state() const { return state_; }

 private:
  void drop_silent_nodes();

  control::OperatorClient client_;
  StudioState state_;
  std::map<std::string, MonotonicInstant> received_at_;  ///< of the last health, by node
};

/// Reports on stderr that messages are not verified, where the client has no studio key.
void report_if_not_verified(const control::OperatorClient& client);

}  // namespace v3d::ctl
