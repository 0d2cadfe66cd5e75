// pulses.lcmlog, written by a thread of its own: who waits for pulses must not wait for the disk.
#pragma once

#include <atomic>
#include <filesystem>
#include <thread>

#include "daemon/bounded_queue.h"
#include "take/frame_log.h"

namespace v3d {

class PulseLog {
 public:
  /// Throws InputError when the log cannot be made.
  PulseLog(const std::filesystem::path& path, LogOpening opening);
  /// Writes what waits.
  ~PulseLog();
  PulseLog(const PulseLog&) = delete;
  PulseLog& operator=(const PulseLog&) = delete;

  /// Returns at once; of a disk that is minutes behind, the oldest pulses are lost, and counted.
  void write(const PulseMessage& pulse);
  /// Pulses that the disk refused, or that it was too slow for.
  int64_t errors() const { return refused_ + queue_.dropped(); }

 private:
  void run();

  EventLogWriter log_;
  BoundedQueue<PulseMessage> queue_;
  std::atomic<int64_t> refused_ = 0;
  std::atomic<bool> stopping_ = false;
  std::thread thread_;
};

}  // namespace v3d
