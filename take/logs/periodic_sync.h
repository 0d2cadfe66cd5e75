// PeriodicSync: syncs a growing file to disk periodically, in a separate thread.
#pragma once

#include <condition_variable>
#include <mutex>
#include <thread>

#include "base/core/time.h"
#include "base/io/file.h"

namespace v3d {

/// Syncs a file once in every period in which it was written to. mark_dirty() and pop_error() do
/// not wait for the disk. One writing thread.
///
/// A write is on disk one period and the duration of a sync after mark_dirty(), unless a sync takes
/// longer than a period. Periods begin at multiples of their length on the monotonic clock, so that
/// all files of a host are synced at the same time: a file system then commits its journal once for
/// all of them.
class PeriodicSync {
 public:
  /// `file` must outlive the object.
  PeriodicSync(const io::File& file, Duration period);
  /// Waits for a running sync; does not sync later writes.
  ~PeriodicSync();
  PeriodicSync(const PeriodicSync&) = delete;
  PeriodicSync& operator=(const PeriodicSync&) = delete;

  void mark_dirty();
  /// The first error since the last call: earlier writes may be lost.
  [[nodiscard]] io::Status pop_error();
  /// Syncs in the calling thread, after a running sync. Returns its error, or that of an earlier
  /// sync as pop_error() does.
  [[nodiscard]] io::Status sync();

 private:
  void run();
  bool wait_until(MonotonicInstant instant);
  void sync_file();

  const io::File& file_;
  const Duration period_;
  std::mutex sync_mutex_;  ///< held during a sync: the kernel reports an error to one sync only
  std::mutex mutex_;       ///< guards the members below
  std::condition_variable stopped_;
  bool stopping_ = false;
  bool is_dirty_ = false;
  io::Status failure_;
  std::thread thread_;  ///< declared last: starts after all other members exist
};

/// True for errors of fsync() and sync_file_range() that mean that the file system does not support
/// the call. Every other error means that written bytes may be lost.
bool is_unsupported_sync(int error);

}  // namespace v3d
