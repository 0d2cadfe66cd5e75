// The operator's end of the bus: commands to every node of a studio, their replies, their health.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/studio_file.h"
#include "base/time.h"
#include "daemon/control/studio_coordinator.h"
#include "wire/messages.h"

namespace v3d {

/// The nodes that answer commands, in the order of the file: those with a camera or the trigger (a
/// v3d-captured each), and the nodes of the reconstruction (v3d-recond).
std::vector<std::string> commanded_nodes(const Studio& studio);

/// False of health that carries no seal of the key here: its node has none or another, or somebody
/// else said it. It shows as a fault.
bool is_believed(const HealthMessage& health);

/// One per process; one thread calls.
class OperatorClient {
 public:
  /// Joins the studio's network. Throws InputError when that is not possible.
  explicit OperatorClient(const Studio& studio);
  ~OperatorClient();
  OperatorClient(const OperatorClient&) = delete;
  OperatorClient& operator=(const OperatorClient&) = delete;

  const std::vector<std::string>& nodes() const;
  /// Why what is shown here is taken for what it says, seal or not: there is no studio key. Empty
  /// when only what is sealed is shown.
  const std::string& not_verified() const;

  /// Carries an order out as Conversation tells, with the MAC of the studio key or the operator's
  /// signature (Credentials), until every node has replied finally, or until `deadline`; what has
  /// to be taken back then takes a little longer. `heard` is called for every new reply, pending
  /// ones included; replies that are not authentic are ignored. Throws InputError when there is no
  /// studio key, or this PC's operator key is no operator's of the member list.
  Answer command(CommandMessage command, MonotonicInstant deadline,
                 const std::function<void(const ReplyMessage&)>& heard = {});

  /// The last health of every node heard since this client began or its last command was answered
  /// (never what was so before the command), waiting until each of nodes() has been heard or until
  /// `deadline`. A node that is missing in the result is silent. One whose health carries no seal
  /// has a fault, and the text begins with "not believed".
  std::map<std::string, HealthMessage> health(MonotonicInstant deadline);

  /// The next health message or event of any node; empty when none came until `deadline`.
  std::optional<HealthMessage> next_health(MonotonicInstant deadline);
  std::optional<EventMessage> next_event(MonotonicInstant deadline);

  /// Meshes as they pass, for `v3dctl watch`. Empty when none came until `deadline`.
  std::optional<MeshMessage> next_mesh(MonotonicInstant deadline);

  /// Pulses as they pass; the first call begins to listen. Empty when none came until `deadline`.
  std::optional<PulseMessage> next_pulse(MonotonicInstant deadline);

  /// Small pictures as they pass; the first call begins to listen. Empty when none came until
  /// `deadline`.
  std::optional<PreviewMessage> next_preview(MonotonicInstant deadline);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace v3d
