// Conclusions from the health of other nodes: whether the pulse train has ended, and whether a disk
// is full.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/core/time.h"
#include "daemon/bus/bus.h"
#include "wire/messages.h"

namespace v3d::node {

/// Health of another node, as it was received.
struct ReceivedHealth {
  wire::HealthMessage health;
  uint64_t session = 0;  ///< ReceivedMessage::session
  MonotonicInstant received;
  MonotonicInstant sent;  ///< latest possible time, on the clock of this PC
};

/// Name of a health value: 1 in the last message of a process that ends after a stop signal.
inline constexpr char kStopping[] = "stopping_flag";

/// Detects which health messages of a node were sent last: by session and sequence number, because
/// the clock of the node may be set back. One thread.
///
/// A process that restarts has a new session. A second process with the name of the node has one,
/// too: its messages are ignored while those of the first process arrive.
class HealthOrder {
 public:
  /// A session ends with a message that has kStopping, or when it has sent none for this long.
  /// Health is sent every second. The times of sending count: a process that was stopped reads the
  /// messages of two sessions at once.
  static constexpr Duration kSilence = std::chrono::seconds(3);

  /// True if the message was sent after all earlier arguments, by the same process or by one that
  /// has replaced it.
  bool is_newest(const ReceivedHealth& message);

 private:
  /// The late messages of more sessions would have to arrive within seconds.
  static constexpr size_t kMaxFormer = 16;

  std::optional<uint64_t> session_;  ///< empty before the first message
  int64_t seq_ = 0;                  ///< of the newest message
  bool has_ended_ = false;           ///< the newest message has kStopping
  MonotonicInstant sent_;            ///< of the newest message
  std::deque<uint64_t> former_;      ///< ended sessions, oldest first
};

/// Largest age of a received message: SessionReplayFilter accepts none that is older than kOldest,
/// plus the delay of a session's response, plus a clock step of less than kAhead.
inline constexpr Duration kMaxHealthAge = bus::SessionReplayFilter::kOldest +
                                          bus::SessionReplayFilter::kAhead +
                                          bus::SessionChallenges::kResponseTimeout;

// State of the pulse train, on the nodes that do not generate the pulses.

/// Derives the state of the train from health messages of the trigger's node. No input or output.
/// One thread.
///
/// Health is sent every second and at each change of state. So the end of a train is detected even
/// when its last pulse failed, when messages are lost, or when the trigger's node has restarted.
class TrainState {
 public:
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
  TrainMonitor(bus::Bus& bus, const std::string& trigger_node);

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
  bus::Subscription<ReceivedHealth> health_;
  TrainState train_;
};

// Detects full or broken disks on other capture nodes, from their health messages. The trigger's
// node then ends the train.

/// Name of a health value: 1 from the time a node ended its part of the take because its disk is
/// full or frames could not be written, until the next take.
inline constexpr char kDiskFull[] = "disk_full_flag";

/// True if `health` has kDiskFull set.
bool reports_full_disk(const wire::HealthMessage& health);

/// Derives from the health messages of a node whether its disk is full. No input or output. One
/// thread.
class FullDiskState {
 public:
  /// Starts a new take: reports about earlier ones are ignored. Call when the train starts.
  void reset(MonotonicInstant now);
  /// For a message that was received before reset(): later ones are compared with it.
  void note(const ReceivedHealth& message) { order_.is_newest(message); }

  /// `take`: the take that this node records.
  void on_health(const ReceivedHealth& message, const std::string& take);
  /// True if the node has ended its part of the take. A message from before reset() does not
  /// count, however late it arrives.
  bool is_full() const { return is_full_; }

 private:
  HealthOrder order_;
  MonotonicInstant began_;   ///< time of the last reset()
  bool has_joined_ = false;  ///< the node has sent health with the name of the take
  bool is_full_ = false;
};

/// A FullDiskState of each other node, with its subscription. Health is sent every second, so a
/// lost message only delays the result. One thread.
class DiskMonitor {
 public:
  /// `bus` outlives the monitor.
  DiskMonitor(bus::Bus& bus, const std::vector<std::string>& nodes);

  /// Discards queued messages and calls FullDiskState::reset().
  void reset();
  /// Reads the messages that have arrived. Returns the name of a node whose disk is full, or an
  /// empty string. Never waits. `take`: the take that this node records.
  std::string full_node(const std::string& take);

 private:
  struct Node {
    std::string name;
    std::unique_ptr<bus::Subscription<ReceivedHealth>> health;
    FullDiskState disk;
  };
  std::vector<Node> nodes_;
};

}  // namespace v3d::node
