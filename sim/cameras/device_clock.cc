#include "sim/cameras/device_clock.h"

#include <utility>

#include "sim/rendering/noise.h"

namespace v3d::sim {

SimulatedClock simulated_clock(int camera, uint64_t seed, MonotonicInstant origin) {
  const uint64_t own = mix(seed ^ 0xC10C) + static_cast<uint64_t>(camera);
  return {from_seconds(uniform(own, 0, 1, 1000)), uniform(own, 1, -50, 50), origin};
}

Duration exposure_delay(int camera, int64_t edge, uint64_t seed) {
  const uint64_t own = mix(mix(seed ^ 0xDE1A) + static_cast<uint64_t>(camera));
  return Duration(static_cast<int64_t>(uniform(own, static_cast<uint64_t>(edge), 4000, 30000)));
}

TimerQueue::TimerQueue() : thread_([this] { run(); }) {}

void TimerQueue::end() {
  {
    const std::lock_guard lock(mutex_);
    quit_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void TimerQueue::at(MonotonicInstant due, std::function<void()> callback) {
  {
    const std::lock_guard lock(mutex_);
    callbacks_.emplace(due, std::move(callback));
  }
  changed_.notify_all();
}

void TimerQueue::run() {
  std::unique_lock lock(mutex_);
  while (!quit_) {
    if (callbacks_.empty()) {
      changed_.wait(lock);
      continue;
    }
    const auto first = callbacks_.begin();
    if (const Duration left = first->first - Monotonic::now(); left > Duration::zero()) {
      changed_.wait_for(lock, left);
      continue;
    }
    const std::function<void()> callback = std::move(first->second);
    callbacks_.erase(first);
    lock.unlock();
    callback();
    lock.lock();
  }
}

}  // namespace v3d::sim
