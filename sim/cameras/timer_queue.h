// A timer queue: runs callbacks at given times on a thread of its own.
#pragma once

#include <condition_variable>
#include <functional>
#include <map>
#include <mutex>
#include <thread>

#include "base/core/time.h"

namespace v3d::sim {

/// Callbacks that are not due at end(), and those added later, are not run.
/// Threads: at() may be called by any thread, including the queue's own thread.
class TimerQueue {
 public:
  TimerQueue();
  ~TimerQueue() { end(); }
  TimerQueue(const TimerQueue&) = delete;
  TimerQueue& operator=(const TimerQueue&) = delete;

  /// Adds a callback, which must not throw. Callbacks with equal times run in the order of the
  /// calls.
  void at(MonotonicInstant due, std::function<void()> callback);
  /// Stops the queue and waits for the running callback. Not to be called by the queue's thread.
  void end();

 private:
  void run();

  std::mutex mutex_;  ///< guards the next members
  std::condition_variable changed_;
  std::multimap<MonotonicInstant, std::function<void()>> callbacks_;
  bool quit_ = false;
  std::thread thread_;
};

}  // namespace v3d::sim
