// Numbers, logs, counts and publishes the pulses of a take.
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "capture/sync/pulse_times.h"
#include "daemon/bus/bus.h"
#include "daemon/captured/pulse_log.h"
#include "daemon/node/service.h"
#include "take/ledger/ledger.h"
#include "trigger/pulse_generator.h"

namespace v3d::captured {

/// When the sensed pulse of a received message was, on the clock of this PC at `now`.
///
/// The clocks of two PCs are compared by the messages that the sender's process has sent
/// (ReceivedMessage::sent_here): their difference is known to the least delay of a message. The
/// compared time is late by this delay, and the wall clocks are not used. Where the time in the
/// message agrees with it within 2 ms, the clocks are synchronised, and the time in the message
/// counts, however late it is received: it is exact where NTP works.
/// Where it does not agree and the message seems to be more than 10 ms old, the message is late or
/// the sender's clock was set back, and the pulse has no time (PulseEdge::is_timed).
/// Without authentication nothing is compared, and a pulse of the future or of more than 200 ms ago
/// has no time.
capture::PulseEdge edge_on_this_pc(const wire::PulseMessage& pulse, const bus::ReceivedMessage& in,
                                   const bus::ReceiverTime& now);

/// A pulse that was sensed here or received, with its time on the clock of this PC.
struct LocalPulse : wire::PulseMessage {
  capture::PulseEdge local_edge;
};

/// On the trigger's node: reads the sense line and publishes each pulse. On other nodes: receives
/// these pulse messages. Lives from arming to the end of the take, with a thread of its own.
class PulseRecorder {
 public:
  /// State of a take that is resumed after a restart.
  struct Resume {
    take::PulseSet sensed;  ///< pulses in the log
    int64_t commanded = 0;  ///< pulses of the train until now, or up to two fewer
  };
  struct Setup {
    std::string take;
    trigger::PulseTrain train;    ///< as commanded
    std::filesystem::path log{};  ///< empty: no log is written
    std::function<void(const capture::PulseEdge&)>
        on_edge;                     ///< called by the thread for every pulse
    std::optional<Resume> resume{};  ///< set: the log is continued
  };
  /// Starts the thread. `sensor` is null on nodes that receive the pulses from the bus; otherwise
  /// it is reset here and read until destruction. `sensor` and `bus` outlive the recorder. Throws
  /// InputError when the sense line or the log cannot be opened.
  PulseRecorder(trigger::PulseSensor* sensor, bus::Bus& bus, Setup setup);
  ~PulseRecorder();
  PulseRecorder(const PulseRecorder&) = delete;
  PulseRecorder& operator=(const PulseRecorder&) = delete;

  /// Call before the generator is started. `now`: the time of the call. Pulses that the sense line
  /// has before it are interference, and extra: no number, message or frame is theirs. On nodes
  /// that receive the pulses it has no effect.
  void start(MonotonicInstant now);

  /// The number of pulses sensed or received.
  int64_t sensed() const;
  /// Sets the sensed, unsensed, extra and runt pulses. `commanded`: pulses until now.
  void fill_ledger(take::Ledger& ledger, int64_t commanded) const;
  /// Extra and runt pulses on one line; empty without any.
  std::string warning() const;
  /// The highest pulse number plus one.
  int64_t seen() const;
  /// Stops the thread and closes the log.
  void close();
  /// After close(): PulseLog::lost() and PulseLog::synced(); 0 and success without a log.
  int64_t lost_in_log() const { return log_ ? log_->lost() : 0; }
  io::Status synced() const { return log_ ? log_->synced() : io::Status(); }
  /// Pulse messages that did not arrive; 0 on the trigger's node.
  int64_t lost_messages() const { return subscription_ ? subscription_->counts().lost : 0; }
  bool progressed_since(MonotonicInstant since) const { return heartbeat_.beat_since(since); }

 private:
  void run();
  std::optional<LocalPulse> next();
  std::optional<LocalPulse> sense();
  std::optional<LocalPulse> receive();
  void record(const LocalPulse& pulse);
  void resend_last();

  trigger::PulseSensor* const sensor_;
  bus::Bus& bus_;
  const std::string take_;
  const std::function<void(const capture::PulseEdge&)> on_edge_;
  std::unique_ptr<bus::Subscription<LocalPulse>> subscription_;
  std::optional<PulseLog> log_;
  int64_t seq_ = 0;
  std::vector<uint8_t> last_message_;  ///< this and the next: the recorder's thread only
  int resends_left_ = 0;
  node::Heartbeat heartbeat_;
  std::atomic<bool> stopping_ = false;
  mutable std::mutex mutex_;  ///< guards the next three
  std::optional<MonotonicInstant> started_;
  trigger::SensedTrain numbers_;
  KnownPulses known_;
  std::thread thread_;
};

}  // namespace v3d::captured
