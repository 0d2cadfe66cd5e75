// A queue between threads that never grows beyond its limit: the oldest goes, and is counted.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <utility>

#include "base/core/time.h"

namespace v3d {

template <class T>
class BoundedQueue {
 public:
  explicit BoundedQueue(size_t limit) : limit_(limit) {}

  /// False when the oldest element had to go to make room.
  bool push(T value) {
    bool room = true;
    {
      const std::lock_guard lock(mutex_);
      if (queue_.size() >= limit_) {
        queue_.pop_front();
        ++dropped_;
        room = false;
      }
      queue_.push_back(std::move(value));
    }
    filled_.notify_one();
    return room;
  }

  /// The oldest element, waiting until `deadline`; empty when none came.
  std::optional<T> pop(MonotonicInstant deadline) {
    std::unique_lock lock(mutex_);
    filled_.wait_until(lock, as_steady(deadline), [&] { return !queue_.empty(); });
    if (queue_.empty()) return std::nullopt;
    std::optional<T> value(std::move(queue_.front()));
    queue_.pop_front();
    return value;
  }

  int64_t dropped() const {
    const std::lock_guard lock(mutex_);
    return dropped_;
  }

 private:
  /// libstdc++'s steady_clock is CLOCK_MONOTONIC, as ours; waiting on it survives a stepped clock.
  static std::chrono::steady_clock::time_point as_steady(MonotonicInstant t) {
    return std::chrono::steady_clock::time_point(t.time_since_epoch());
  }

  const size_t limit_;
  mutable std::mutex mutex_;
  std::condition_variable filled_;
  std::deque<T> queue_;
  int64_t dropped_ = 0;
};

}  // namespace v3d
