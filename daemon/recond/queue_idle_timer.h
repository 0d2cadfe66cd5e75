// How long nothing has come into an inbox, as the thread knows that reads it.
#pragma once

#include <atomic>

#include "base/time.h"

namespace v3d {

/// While the reader stands still, what waits for it is not counted as quiet.
class QueueIdleTimer {
 public:
  // By the reader.
  void took_one(MonotonicInstant now) { taken_ = now; }
  void found_none(MonotonicInstant now) { looked_ = now; }

  /// When the reader last found the inbox empty, it had taken nothing for so long. Any thread.
  bool lasted(Duration quiet) const {
    // In this order: a message that is taken meanwhile ends the quiet.
    const MonotonicInstant looked = looked_, taken = taken_;
    return looked - taken >= quiet;
  }

 private:
  std::atomic<MonotonicInstant> taken_ = Monotonic::now();
  std::atomic<MonotonicInstant> looked_ = MonotonicInstant();
};

}  // namespace v3d
