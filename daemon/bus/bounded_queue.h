// A queue between threads with a size limit. A push to a full queue drops and counts the oldest
// element.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <utility>

#include "base/core/time.h"

namespace v3d {

/// All functions may be called from any thread. `limit` is in elements.
template <class T>
class BoundedQueue {
 public:
  explicit BoundedQueue(size_t limit) : limit_(limit) {}

  /// Returns false when the oldest element was dropped.
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

  /// Waits until `deadline` and removes the oldest element; empty when there is none.
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
  /// libstdc++'s steady_clock is CLOCK_MONOTONIC, like Monotonic. A step of the wall clock does not
  /// change such a wait.
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
