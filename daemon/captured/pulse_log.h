// Asynchronous writer of pulses.lcmlog, so that the thread that receives pulses never waits for the
// disk.
#pragma once

#include <atomic>
#include <filesystem>
#include <thread>

#include "base/io/result.h"
#include "daemon/bus/bounded_queue.h"
#include "take/logs/frame_log.h"

namespace v3d {

/// Writes in a thread of its own. EventLogWriter syncs the log, also when no pulse follows.
class PulseLog {
 public:
  /// Creates or continues the log. Its name survives a power cut from then on. Throws InputError
  /// when the log cannot be opened.
  PulseLog(const std::filesystem::path& path, LogOpening opening,
           Duration sync_period = EventLogWriter::kSyncPeriod);
  /// Calls close().
  ~PulseLog();
  PulseLog(const PulseLog&) = delete;
  PulseLog& operator=(const PulseLog&) = delete;

  /// Queues the pulse and returns at once. When 4,096 pulses are queued, the oldest is dropped and
  /// counted as lost.
  void write(const PulseMessage& pulse);
  /// Writes the queued pulses, flushes to disk and stops the thread. Idempotent.
  void close();
  /// Pulses that could not be written, or were dropped from the queue. Final after close(). The
  /// first error is also written to the daemon's log.
  int64_t lost() const { return failed_ + queue_.dropped(); }
  /// After close(): whether flushing to disk succeeded, else its error.
  const io::Status& synced() const { return synced_; }

 private:
  void run();

  EventLogWriter log_;
  BoundedQueue<PulseMessage> queue_;
  std::atomic<int64_t> failed_ = 0;
  io::Status synced_;
  std::atomic<bool> stopping_ = false;
  std::thread thread_;
};

}  // namespace v3d
