// Numbers, logs, counts and publishes the pulses of a take.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "base/config/studio_values.h"
#include "base/io/file.h"
#include "capture/sync/pulse_times.h"
#include "daemon/bus/bus.h"
#include "daemon/bus/subscription_queue.h"
#include "daemon/node/service.h"
#include "take/ledger/ledger.h"
#include "take/logs/frame_log.h"
#include "trigger/pulse_generator.h"
#include "wire/messages.h"

namespace v3d::captured {

// Asynchronous writer of pulses.lcmlog, so that the thread that receives pulses never waits for the
// disk.

/// Writes in a thread of its own. EventLogWriter syncs the log, also when no pulse follows.
class PulseLog {
 public:
  /// Creates or continues the log. Its name survives a power cut from then on. Throws InputError
  /// when the log cannot be opened.
  PulseLog(const std::filesystem::path& path, take::LogOpening opening,
           Duration sync_period = take::EventLogWriter::kSyncPeriod);
  /// Calls close().
  ~PulseLog();
  PulseLog(const PulseLog&) = delete;
  PulseLog& operator=(const PulseLog&) = delete;

  /// Queues the pulse and returns at once. When 4,096 pulses are queued, the oldest is dropped and
  /// counted as lost. `edge_here`: see EventLogWriter::write().
  void write(const wire::PulseMessage& pulse, std::optional<RealtimeInstant> edge_here = {});
  /// Writes the queued pulses, flushes to disk and stops the thread. Idempotent.
  void close();
  /// Pulses that could not be written, or were dropped from the queue. Final after close(). The
  /// first error is also written to the daemon's log.
  int64_t lost() const { return failed_ + queue_.dropped(); }
  /// After close(): whether flushing to disk succeeded, else its error.
  const io::Status& synced() const { return synced_; }

 private:
  struct Entry {
    wire::PulseMessage pulse;
    std::optional<RealtimeInstant> edge_here{};
  };
  void run();

  take::EventLogWriter log_;
  bus::BoundedQueue<Entry> queue_;
  std::atomic<int64_t> failed_ = 0;
  io::Status synced_;
  std::atomic<bool> stopping_ = false;
  std::thread thread_;
};

// The pulse numbers that a node has sensed or received, and rules for the ledger that depend on
// them. No input or output.

/// The pulses of one take that this node has sensed or received. One thread.
class KnownPulses {
 public:
  /// `now` is the time of the first possible pulse.
  KnownPulses(std::string take, MonotonicInstant now);
  /// Resumes a take after a restart. `sensed`: pulses in the log. `commanded`: pulses of the train
  /// until now, or up to two fewer.
  KnownPulses(std::string take, take::PulseSet sensed, int64_t commanded, MonotonicInstant now);

  /// False for a pulse message of another take, for a number below seen(), and for a number that is
  /// not in PlausiblePulses.
  bool accepts(const wire::PulseMessage& pulse, MonotonicInstant now) const;
  void add(int64_t pulse, MonotonicInstant now);

  /// The highest pulse number plus one.
  int64_t seen() const { return seen_; }
  /// The number of pulses sensed or received.
  int64_t count() const { return sensed_.size(); }
  /// Sets the number of sensed pulses and the list of those not sensed, out of `commanded`.
  void fill_ledger(take::Ledger& ledger, int64_t commanded) const;

 private:
  std::string take_;
  take::PulseSet sensed_;
  int64_t seen_ = 0;
  PlausiblePulses plausible_;
};

/// Whether the ledger may state how many pulses were sensed. It may not without a sense line, nor
/// on a node that receives pulse messages from the trigger's node and has lost some. `sensed`:
/// pulses sensed or received here.
bool sensed_count_is_known(bool has_sense_line, bool senses_here, int64_t sensed,
                           int64_t commanded);

/// Whether a take with this ledger is empty and belongs into the quarantine.
///
/// A take with frames is not empty, even without pulses: the messages of the trigger's node may
/// have been lost. Neither is a take that was started with the trigger on another node: pulses may
/// have run after this node's part ended, and the ledger must list its cameras as missing them.
bool is_empty_take(const take::Ledger& ledger, bool was_started, bool trigger_is_here);

// Numbers, logs, counts and publishes the pulses of a take.

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
