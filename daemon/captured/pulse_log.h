// pulses.lcmlog, written by a thread of its own: who waits for pulses must not wait for the disk.
#pragma once

#include <atomic>
#include <filesystem>
#include <thread>

#include "daemon/bus/bounded_queue.h"
#include "take/logs/frame_log.h"

namespace v3d {

class PulseLog {
 public:
  /// The name of the log survives a power cut from then on. Throws InputError when the log cannot
  /// be made.
  PulseLog(const std::filesystem::path& path, LogOpening opening);
  /// As close().
  ~PulseLog();
  PulseLog(const PulseLog&) = delete;
  PulseLog& operator=(const PulseLog&) = delete;

  /// Returns at once; of a disk that is minutes behind, the oldest pulses are lost, and counted.
  void write(const PulseMessage& pulse);
  /// Writes what waits, and waits until the disk has it. lost() is final then.
  void close();
  /// Pulses that could not be written, or for which the disk was too slow. The first error is in
  /// the daemon's log, too.
  int64_t lost() const { return refused_ + queue_.dropped(); }
  /// After close(): the disk has kept what it took.
  bool is_kept() const { return kept_; }

 private:
  void run();

  EventLogWriter log_;
  BoundedQueue<PulseMessage> queue_;
  std::atomic<int64_t> refused_ = 0;
  bool kept_ = true;
  std::atomic<bool> stopping_ = false;
  std::thread thread_;
};

}  // namespace v3d
