// State of the pulse train, on the nodes that do not generate the pulses.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "daemon/bus/bus.h"

namespace v3d {

/// Derives the state of the train from health messages of the trigger's node. No input or output.
/// One thread.
///
/// Health is sent every second and at each change of state. So the end of a train is detected even
/// when its last pulse failed, when messages are lost, or when the trigger's node has restarted.
class TrainState {
 public:
  /// Starts a new train: earlier messages are ignored. Call when the trigger's node is armed.
  void reset() { *this = {}; }

  /// The take that the trigger's node records; `take` is empty when it records none.
  struct RunningTake {
    std::string take;
    int64_t commanded = 0;  ///< pulses, according to the last message
  };
  /// For a node without an active take; replaces on_health(). Empty for a message that is older
  /// than the newest one.
  std::optional<RunningTake> running(const HealthMessage& health);

  /// `take`: the take that this node records.
  void on_health(const HealthMessage& health, const std::string& take);
  /// True once the trigger's node was neither armed for the take nor recording it.
  bool ended() const { return ended_; }
  /// Pulses of the take that have been commanded, according to the last message.
  int64_t commanded() const { return commanded_; }

 private:
  bool is_newer(const HealthMessage& health);

  bool ended_ = false;
  bool was_running_ = false;                   ///< the trigger's node was armed or recording
  std::optional<RealtimeInstant> first_sent_;  ///< of the first message, by that node's clock
  RealtimeInstant newest_sent_;
  int64_t commanded_ = 0;
};

/// A TrainState with its subscription. One thread.
class TrainMonitor {
 public:
  using RunningTake = TrainState::RunningTake;

  /// `bus` outlives the monitor.
  TrainMonitor(Bus& bus, const std::string& trigger_node);

  /// Discards queued messages and calls TrainState::reset().
  void reset();
  /// For a node without an active take; replaces poll(). The take that the trigger's node records,
  /// from its newest message; empty when none has arrived since the last call.
  std::optional<RunningTake> running();

  /// Reads the messages that have arrived. Never waits; call it often. `take`: the take that this
  /// node records.
  void poll(const std::string& take);
  bool ended() const { return train_.ended(); }
  int64_t commanded() const { return train_.commanded(); }

 private:
  Subscription<HealthMessage> health_;
  TrainState train_;
};

}  // namespace v3d
