// Things to be done at a certain time, by a thread of their own.
#pragma once

#include <condition_variable>
#include <functional>
#include <map>
#include <mutex>
#include <thread>

#include "base/time.h"

namespace v3d::sim {

/// What is not yet due when this ends, or is asked for afterwards, is not done. at() may be called
/// by any thread, by the one that does the things, too.
class Later {
 public:
  Later();
  ~Later() { end(); }
  Later(const Later&) = delete;
  Later& operator=(const Later&) = delete;

  /// `thing` must not throw. Things due at the same time are done in the order of their asking.
  void at(MonotonicInstant due, std::function<void()> thing);
  /// Waits for the thing that is being done. Not by the thread that does the things.
  void end();

 private:
  void run();

  std::mutex mutex_;  ///< what follows
  std::condition_variable changed_;
  std::multimap<MonotonicInstant, std::function<void()>> things_;
  bool quit_ = false;
  std::thread thread_;
};

}  // namespace v3d::sim
