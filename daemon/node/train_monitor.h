// Whether pulses still come, on the nodes that do not make them.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "daemon/bus/bus.h"

namespace v3d {

/// What the health of the trigger's node says of a train. Health comes again every second, and when
/// the state changes: so the end of a train is noticed even when its last pulse was left out, when
/// messages are lost, and when the trigger's node has restarted in the middle. Pure. One thread.
class TrainState {
 public:
  /// A train begins: what was heard before does not count. The trigger's node is armed by now.
  void restart() { *this = {}; }

  /// What the trigger's node records: nothing where the name is empty.
  struct Running {
    std::string take;
    int64_t commanded = 0;  ///< pulses, as far as was heard
  };
  /// For a node that is at no take; instead of on_health(). Empty where newer health is known.
  std::optional<Running> running(const HealthMessage& health);

  /// `take` is the one that is recorded here.
  void on_health(const HealthMessage& health, const std::string& take);
  /// True once that node was neither armed nor recording for the take.
  bool ended() const { return ended_; }
  /// Pulses of the take that it has commanded, as far as was heard.
  int64_t commanded() const { return commanded_; }

 private:
  bool is_news(const HealthMessage& health);

  bool ended_ = false;
  bool runs_ = false;                     ///< it was heard to be armed or to record
  std::optional<RealtimeInstant> first_;  ///< when the first word was sent, by that node's clock
  RealtimeInstant newest_;
  int64_t commanded_ = 0;
};

/// A TrainState that listens on the bus. One thread.
class TrainMonitor {
 public:
  using Running = TrainState::Running;

  /// `bus` outlives the watch.
  TrainMonitor(Bus& bus, const std::string& trigger_node);

  /// As TrainState::restart().
  void restart();
  /// What the trigger's node was last heard to record; empty when it has not been heard since
  /// restart(). For who is at no take; instead of listen().
  std::optional<Running> running();

  /// Hears what has come since; to be called often. `take` is the one that is recorded.
  void listen(const std::string& take);
  bool ended() const { return train_.ended(); }
  int64_t commanded() const { return train_.commanded(); }

 private:
  Subscription<HealthMessage> health_;
  TrainState train_;
};

}  // namespace v3d
