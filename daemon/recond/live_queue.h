// What waits for the reconstruction, and what is dropped when it cannot keep up.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <utility>

#include "base/time.h"

namespace v3d {

/// Live is live: the mesh on the screen shall be of now. But a machine that hesitated for a moment
/// shall make up for it without losing a pulse. So
///   - what waits is taken in order, the oldest first, as long as the queue runs empty now and
///   then;
///   - when something has been left waiting for `patience` without a break, or more than `limit`
///     wait, the reader is behind: from now on it is given the newest, and all that are older are
///     dropped and counted. So the loss is spread evenly and the latency is that of the work alone;
///   - when nothing had to be dropped for `calm`, it keeps up again.
/// Any thread; time is an argument, and never goes back.
template <class T>
class LiveQueue {
 public:
  struct Options {
    size_t limit = 25;  ///< a second at 25 Hz
    Duration patience = std::chrono::seconds(10);
    Duration calm = std::chrono::seconds(10);
    /// Is told what is dropped. Runs with the queue locked.
    std::function<void(const T&)> on_drop = [](const T&) {};
  };
  LiveQueue() : LiveQueue(Options{}) {}
  explicit LiveQueue(Options options) : options_(std::move(options)) {}

  void push(T value, MonotonicInstant now) {
    {
      const std::lock_guard lock(mutex_);
      queue_.push_back(std::move(value));
      if (queue_.size() > options_.limit) drop_oldest(now);
    }
    filled_.notify_one();
  }

  /// What to work on next; empty when nothing waits.
  std::optional<T> take(MonotonicInstant now) {
    const std::lock_guard lock(mutex_);
    if (queue_.empty()) return std::nullopt;
    while (is_behind(now) && queue_.size() > 1) drop_oldest(now);
    std::optional<T> value(std::move(queue_.front()));
    queue_.pop_front();
    if (queue_.empty()) {
      left_waiting_since_.reset();
    } else if (!left_waiting_since_) {
      left_waiting_since_ = now;
    }
    return value;
  }

  /// Nobody will take what waits.
  void drop_all(MonotonicInstant now) {
    const std::lock_guard lock(mutex_);
    while (!queue_.empty()) drop_oldest(now);
  }

  /// False when nothing came until `deadline`.
  bool wait(MonotonicInstant deadline) {
    std::unique_lock lock(mutex_);
    // libstdc++'s steady_clock is CLOCK_MONOTONIC, as ours.
    return filled_.wait_until(lock,
                              std::chrono::steady_clock::time_point(deadline.time_since_epoch()),
                              [&] { return !queue_.empty(); });
  }

  size_t size() const {
    const std::lock_guard lock(mutex_);
    return queue_.size();
  }
  int64_t dropped() const {
    const std::lock_guard lock(mutex_);
    return dropped_;
  }
  /// Drops, or did so not long ago.
  bool behind(MonotonicInstant now) const {
    const std::lock_guard lock(mutex_);
    return is_behind(now);
  }

 private:
  bool is_behind(MonotonicInstant now) const {
    return (last_drop_ && now - *last_drop_ < options_.calm) ||
           (left_waiting_since_ && now - *left_waiting_since_ >= options_.patience);
  }
  void drop_oldest(MonotonicInstant now) {
    options_.on_drop(queue_.front());
    queue_.pop_front();
    ++dropped_;
    last_drop_ = now;
  }

  const Options options_;
  mutable std::mutex mutex_;  ///< what follows
  std::condition_variable filled_;
  std::deque<T> queue_;
  std::optional<MonotonicInstant> left_waiting_since_;
  std::optional<MonotonicInstant> last_drop_;
  int64_t dropped_ = 0;
};

}  // namespace v3d
