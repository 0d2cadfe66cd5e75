// FsyncHook: counts the calls of fsync() in a test program, and makes them fail or block.
#pragma once

#include <condition_variable>
#include <mutex>
#include <thread>

namespace v3d::test {

/// Replaces fsync() for regular files during its lifetime. One object at a time; thread-safe.
class FsyncHook {
 public:
  FsyncHook();
  ~FsyncHook();
  FsyncHook(const FsyncHook&) = delete;
  FsyncHook& operator=(const FsyncHook&) = delete;

  /// Called instead of fsync(). The result of the call; -1 with errno after fail_next(). Blocks
  /// while held, at most ten seconds.
  int on_sync(int fd);

  /// Waits for the given number of calls. False when there were fewer within ten seconds.
  bool wait_for(int syncs);
  /// Number of calls until now.
  int syncs();
  void hold(bool holds);
  void fail_next(int error);
  /// True when a call was blocked for ten seconds.
  bool is_stuck();
  /// The thread and the length of the file, bytes, of the last call.
  std::thread::id thread();
  long bytes();

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  int syncs_ = 0;
  bool holds_ = false;
  int error_ = 0;
  bool is_stuck_ = false;
  std::thread::id thread_;
  long bytes_ = 0;
};

}  // namespace v3d::test
