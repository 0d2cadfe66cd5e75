// Clocks and timers of simulated cameras.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <thread>

#include "base/core/time.h"

namespace v3d::sim {

// Simulated camera clocks with offset and drift.

struct SimulatedClock {
  Duration offset{};     ///< the device's reading when CLOCK_MONOTONIC is `origin`
  double drift_ppm = 0;  ///< how much faster than CLOCK_MONOTONIC it runs
  MonotonicInstant origin;

  DeviceInstant at(MonotonicInstant t) const {
    const Duration since = t - origin;
    const auto gained = static_cast<int64_t>(static_cast<double>(since.count()) * drift_ppm * 1e-6);
    return DeviceInstant(offset + since + Duration(gained));
  }
};

/// The clock of a camera: a random offset within 1000 s and a random drift within 50 ppm. At
/// `origin` the clock shows its offset.
SimulatedClock simulated_clock(int camera, uint64_t seed, MonotonicInstant origin);

/// Random delay from a trigger edge to the start of exposure, 4 to 30 microseconds.
Duration exposure_delay(int camera, int64_t edge, uint64_t seed);

// A timer queue: runs callbacks at given times on a thread of its own.

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
