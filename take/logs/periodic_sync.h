// PeriodicSync: brings what is written to a file to the disk, on a thread of its own.
#pragma once

#include <condition_variable>
#include <mutex>
#include <thread>

#include "base/core/time.h"
#include "base/io/file.h"

namespace v3d {

/// Syncs a file once in every period in which something was written. note_write() and
/// take_failure() do not wait for the disk. One writing thread.
class PeriodicSync {
 public:
  /// `file` outlives the object.
  PeriodicSync(const io::File& file, Duration period);
  /// Waits for a sync that is running; does not sync what was written since.
  ~PeriodicSync();
  PeriodicSync(const PeriodicSync&) = delete;
  PeriodicSync& operator=(const PeriodicSync&) = delete;

  void note_write();
  /// The first failure since the last call: the disk may have lost what was written before.
  [[nodiscard]] io::Status take_failure();

 private:
  void run();

  const io::File& file_;
  const Duration period_;
  std::mutex mutex_;  ///< what follows
  std::condition_variable stopped_;
  bool stopping_ = false;
  bool is_dirty_ = false;
  io::Status failure_;
  std::thread thread_;  ///< last
};

}  // namespace v3d
