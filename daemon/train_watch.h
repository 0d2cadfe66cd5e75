// Whether pulses still come, on the nodes that do not make them.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "daemon/bus.h"

namespace v3d {

/// Listens to the health of the trigger's node. Health comes again every second, and when the state
/// changes: so the end of a train is heard of even when its last pulse was left out, when messages
/// are lost, and when the trigger's node has begun anew in the middle. One thread.
class TrainWatch {
 public:
  /// `bus` outlives the watch.
  TrainWatch(Bus& bus, const std::string& trigger_node);

  /// A train begins: what was heard before does not count. The trigger's node is armed by now.
  void restart();
  /// What the trigger's node was last heard to record: nothing where the name is empty. Empty when
  /// it has not been heard since restart(). For who is at no take; instead of listen().
  struct Running {
    std::string take;
    int64_t commanded = 0;  ///< pulses, as far as was heard
  };
  std::optional<Running> running();

  /// Hears what has come since; to be called often. `take` is the one that is recorded.
  void listen(const std::string& take);
  /// True once that node was neither armed nor recording for the take.
  bool ended() const { return ended_; }
  /// Pulses of the take that it has commanded, as far as was heard.
  int64_t commanded() const { return commanded_; }

 private:
  bool is_news(const HealthMessage& health);
  void hear(const HealthMessage& health, const std::string& take);

  Subscription<HealthMessage> health_;
  bool ended_ = false;
  bool runs_ = false;                     ///< it was heard to be armed or to record
  std::optional<RealtimeInstant> first_;  ///< when the first word was sent, by that node's clock
  RealtimeInstant newest_;
  int64_t commanded_ = 0;
};

}  // namespace v3d
