// Time of the last iteration of a thread's main loop. The watchdog is fed only while every thread
// of the pipeline iterates.
#pragma once

#include <atomic>

#include "base/core/time.h"

namespace v3d {

/// Any thread.
class Heartbeat {
 public:
  /// Call once per iteration.
  void beat() { last_ = to_ns(Monotonic::now()); }
  bool beat_since(MonotonicInstant t) const { return last_ >= to_ns(t); }

 private:
  std::atomic<int64_t> last_ = to_ns(Monotonic::now());
};

}  // namespace v3d
