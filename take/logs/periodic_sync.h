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

 private:
  void run();

  const io::File& file_;
  const Duration period_;
  std::mutex mutex_;  ///< guards the members below
  std::condition_variable stopped_;
  bool stopping_ = false;
  bool is_dirty_ = false;
  io::Status failure_;
  std::thread thread_;  ///< declared last: starts after all other members exist
};

}  // namespace v3d
