// Pulses on disk and in memory.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "base/config/studio_values.h"
#include "base/io/file.h"
#include "daemon/bus/subscription_queue.h"
#include "take/ledger/ledger.h"
#include "take/logs/frame_log.h"
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

}  // namespace v3d::captured
