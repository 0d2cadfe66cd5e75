// State of the pulse train, on the nodes that do not generate the pulses.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>

#include "daemon/bus/bus.h"

namespace v3d {

/// Health of the trigger's node, as it was received.
struct ReceivedHealth {
  HealthMessage health;
  uint64_t session = 0;  ///< ReceivedMessage::session
  MonotonicInstant received;
};

/// Detects which health messages of a node were sent last: by session and sequence number, because
/// the clock of the node may be set back. One thread.
class HealthOrder {
 public:
  /// True if the message was sent after all earlier arguments. A session that was not known before
  /// replaces the current one: the process has restarted.
  bool is_newest(const ReceivedHealth& message);

 private:
  /// The late messages of more sessions would have to arrive within seconds.
  static constexpr size_t kMaxFormer = 16;

  std::optional<uint64_t> session_;  ///< empty before the first message
  int64_t seq_ = 0;                  ///< of the newest message
  std::deque<uint64_t> former_;      ///< ended sessions, oldest first
};

/// Derives the state of the train from health messages of the trigger's node. No input or output.
/// One thread.
///
/// Health is sent every second and at each change of state. So the end of a train is detected even
/// when its last pulse failed, when messages are lost, or when the trigger's node has restarted.
class TrainState {
 public:
  /// Largest age of a received message: SessionReplayFilter accepts none that is older than
  /// kOldest, plus the delay of a session's answer, plus a clock step of less than kAhead.
  static constexpr Duration kMaxAge = SessionReplayFilter::kOldest + SessionReplayFilter::kAhead +
                                      SessionQuestions::kAnsweredWithin;

  /// Starts a new train: earlier messages are ignored. Call when the trigger's node is armed.
  void reset(MonotonicInstant now);
  /// For a message that was received before reset(): later ones are compared with it.
  void note(const ReceivedHealth& message) { order_.is_newest(message); }

  /// The take that the trigger's node records; `take` is empty when it records none.
  struct RunningTake {
    std::string take;
    int64_t commanded = 0;  ///< pulses, according to the last message
  };
  /// For a node without an active take; replaces on_health(). Empty for a message that is older
  /// than the newest one. A node that rejoins the take calls on_health() next, without reset().
  std::optional<RunningTake> running(const ReceivedHealth& message);

  /// `take`: the take that this node records.
  void on_health(const ReceivedHealth& message, const std::string& take);
  /// True once the trigger's node was neither armed for the take nor recording it. A message from
  /// before reset() does not count, however late it arrives.
  bool ended() const { return ended_; }
  /// Pulses of the take that have been commanded, according to the last message.
  int64_t commanded() const { return commanded_; }

 private:
  HealthOrder order_;
  MonotonicInstant began_;  ///< time of the last reset()
  bool ended_ = false;
  bool was_running_ = false;  ///< the trigger's node was armed or recording
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
  Subscription<ReceivedHealth> health_;
  TrainState train_;
};

}  // namespace v3d
