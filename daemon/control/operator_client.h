// The operator's connection to a studio: sends commands, receives replies, health and live
// messages.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/config/studio_file.h"
#include "base/core/time.h"
#include "daemon/control/studio_coordinator.h"
#include "wire/messages.h"

namespace v3d::control {

/// The nodes that execute commands, in the order of the studio file: capture nodes, which have a
/// camera or the trigger, and reconstruction nodes.
std::vector<std::string> commanded_nodes(const Studio& studio);

/// False for health without a valid MAC or, where members are required, without the signature of
/// its node. Causes: the node has no key or another one, an attacker sent it, or the member list
/// cannot be read here. It is shown as a fault.
bool is_verified(const wire::HealthMessage& health);

/// One thread. Use one client per process: each has its own sender name and counters.
class OperatorClient {
 public:
  /// Joins the studio's network. Throws InputError if that fails.
  explicit OperatorClient(const Studio& studio);
  ~OperatorClient();
  OperatorClient(const OperatorClient&) = delete;
  OperatorClient& operator=(const OperatorClient&) = delete;

  const std::vector<std::string>& nodes() const;
  /// Why messages are accepted unverified: there is no studio key yet. Empty if they are verified.
  std::string not_verified() const;

  /// Executes an order with a StudioCoordinator until every node has sent a final reply, or until
  /// `deadline`. Taking back takes up to StudioCoordinator::kTakeBackTimeout longer. Commands carry
  /// the MAC of the studio key or the operator's signature (Credentials). `on_reply` is called for
  /// every new reply, also pending ones; replies that are not authentic are ignored. Throws
  /// InputError if there is no studio key, or if the operator key of this PC is not an operator's
  /// in the member list.
  Answer command(wire::CommandMessage command, MonotonicInstant deadline,
                 const std::function<void(const wire::ReplyMessage&)>& on_reply = {});

  /// The last health of each node since construction or the end of the last command. Waits until
  /// each of nodes() has sent one, or until `deadline`. A node that is missing in the result is
  /// silent. Unverified health shows a fault, with a text that begins with "not verified".
  std::map<std::string, wire::HealthMessage> health(MonotonicInstant deadline);

  /// The next health message or event of any node; empty if none arrives until `deadline`.
  std::optional<wire::HealthMessage> next_health(MonotonicInstant deadline);
  std::optional<wire::EventMessage> next_event(MonotonicInstant deadline);

  /// The next live mesh. Empty if none arrives until `deadline`. The first call subscribes.
  std::optional<wire::MeshMessage> next_mesh(MonotonicInstant deadline);
  /// Number of live meshes that next_mesh() does not return, because more than kMeshQueue waited.
  int64_t dropped_meshes() const;
  /// A node that begins to publish sends the meshes of a second at once.
  static constexpr size_t kMeshQueue = 64;

  /// The next pulse. Empty if none arrives until `deadline`. The first call subscribes.
  std::optional<wire::PulseMessage> next_pulse(MonotonicInstant deadline);

  /// The next preview image. Empty if none arrives until `deadline`. The first call subscribes.
  std::optional<wire::PreviewMessage> next_preview(MonotonicInstant deadline);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace v3d::control
