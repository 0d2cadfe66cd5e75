// What a daemon keeps over a restart: the order of the running take, the state of its pulse train.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "base/config/studio_file.h"
#include "base/core/time.h"
#include "base/io/file.h"
#include "daemon/bus/bus.h"
#include "take/take.h"
#include "wire/messages.h"

namespace v3d::node {

// State of the pulse train, on the nodes that do not generate the pulses.

/// Health of the trigger's node, as it was received.
struct ReceivedHealth {
  wire::HealthMessage health;
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
  static constexpr Duration kMaxAge = bus::SessionReplayFilter::kOldest +
                                      bus::SessionReplayFilter::kAhead +
                                      bus::SessionQuestions::kAnsweredWithin;

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

// Persists the order of a node's take in the folder of the take. A daemon that restarts during the
// take resumes it; after the take, it can still report the result.

/// Saves the order. Call when the take is armed; the file exists until the next order. A write
/// error is only logged: a restarted daemon then cannot resume the take.
void persist_command(const Studio& studio, const std::string& node,
                     const wire::CommandMessage& order);
/// Deletes the order of one take.
void drop_command(const Studio& studio, const std::string& node, const std::string& take);
/// Whether the folder of a take has an order of this node. Fails with path and cause.
[[nodiscard]] io::Result<bool> has_persisted_command(const take::TakePaths& take,
                                                     const std::string& node);

struct CommandsOnDisk {
  /// By take name; the take may have ended. Has more than one entry when take folders were copied
  /// to this PC.
  std::map<std::string, wire::CommandMessage> commands;
  std::set<std::string> unread;   ///< takes whose order cannot be read
  bool folder_was_listed = true;  ///< false: there may be others
};
/// The saved orders of this node. Logs why an order cannot be read.
CommandsOnDisk persisted_commands(const Studio& studio, const std::string& node);

/// Decides once whether a restarted node rejoins the running take. No input or output. One thread.
class RejoinDecision {
 public:
  struct Found {
    wire::CommandMessage order;
    int64_t commanded = 0;  ///< pulses of the take until now, or a little fewer
  };
  /// `persisted`: the orders on this node's disk, by take name.
  explicit RejoinDecision(std::map<std::string, wire::CommandMessage> persisted)
      : commands_(std::move(persisted)) {}

  /// False once the decision has been made, and without persisted orders.
  bool is_open() const { return !commands_.empty(); }
  /// The order of the running take, if it was persisted. Call with the first health of the
  /// trigger's node; closes the decision.
  std::optional<Found> decide(const TrainState::RunningTake& running);
  /// Call when the node receives a new order.
  void close() { commands_.clear(); }

 private:
  std::map<std::string, wire::CommandMessage> commands_;
};

/// The persisted orders of a node, and whether one of them belongs to the running take. One thread.
class PersistedCommands {
 public:
  PersistedCommands(const Studio& studio, std::string node);

  using Found = RejoinDecision::Found;
  /// The order of the running take, at most once. Reads the health of the trigger's node; the first
  /// message decides. While an order cannot be read, it reads all again every second, and decides
  /// by a later message. Call often, until drop_all().
  std::optional<Found> find_running(TrainMonitor& train);
  /// Deletes all persisted orders, on disk too. Call when the node receives a new order.
  void drop_all();

 private:
  void read();

  const Studio& studio_;
  const std::string node_;
  CommandsOnDisk on_disk_;  ///< but for the commands, which decision_ has
  MonotonicInstant read_at_;
  RejoinDecision decision_;
};

}  // namespace v3d::node
