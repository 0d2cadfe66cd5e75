// When a thread last went round its loop: the watchdog is fed only while all of them do.
#pragma once

#include <atomic>

#include "base/time.h"

namespace v3d {

class Heartbeat {
 public:
  void beat() { last_ = to_ns(Monotonic::now()); }
  bool since(MonotonicInstant t) const { return last_ >= to_ns(t); }

 private:
  std::atomic<int64_t> last_ = to_ns(Monotonic::now());
};

}  // namespace v3d
