// HeldWrites: makes writes of sound files wait in a test program.
#pragma once

#include <condition_variable>
#include <mutex>

namespace v3d::test {

/// pwritev() of a file .wav waits from the construction to release(). One object at a time;
/// thread-safe.
class HeldWrites {
 public:
  HeldWrites();
  /// As release().
  ~HeldWrites();
  HeldWrites(const HeldWrites&) = delete;
  HeldWrites& operator=(const HeldWrites&) = delete;

  /// Called before a write. Waits while held.
  void on_write();
  /// Returns when a write waits. False when none does within a minute.
  bool wait_for_write();
  void release();

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool holds_ = true;
  int waiting_ = 0;  ///< writes
};

}  // namespace v3d::test
