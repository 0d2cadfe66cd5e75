// The queue of frame sets that wait for the reconstruction. It drops sets when the reader cannot
// keep up.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <utility>

#include "base/core/time.h"

namespace v3d::recond {

/// A bounded queue with a drop policy for live display:
///   - Values are popped oldest first, as long as the queue becomes empty now and then. So a short
///     pause of the reader loses nothing.
///   - When values have waited without a break for `backlog_timeout` and their number has not
///     fallen meanwhile, or more than `limit` wait, the reader is behind. From then on pop()
///     returns the newest value; older ones are dropped and counted. This spreads the loss evenly,
///     and the queue adds no latency.
///   - After `recovery_time` without a drop the reader is no longer behind.
///
/// Thread-safe. The times that are passed must not decrease.
template <class T>
class LiveQueue {
 public:
  struct Options {
    size_t limit = 25;  ///< values: one second at 25 Hz
    Duration backlog_timeout = std::chrono::seconds(10);
    Duration recovery_time = std::chrono::seconds(10);
    /// Receives each dropped value. Called with the queue locked.
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

  /// Removes and returns the next value; empty when none waits.
  std::optional<T> pop(MonotonicInstant now) {
    const std::lock_guard lock(mutex_);
    if (queue_.empty()) return std::nullopt;
    while (is_behind(now) && queue_.size() > 1) drop_oldest(now);
    std::optional<T> value(std::move(queue_.front()));
    queue_.pop_front();
    if (queue_.empty()) {
      backlog_since_.reset();
    } else if (!backlog_since_ || queue_.size() < backlog_) {
      backlog_since_ = now;
      backlog_ = queue_.size();
    }
    return value;
  }

  /// Drops all that wait: the reader has ended.
  void drop_all(MonotonicInstant now) {
    const std::lock_guard lock(mutex_);
    while (!queue_.empty()) drop_oldest(now);
  }

  /// Waits for a value. Returns false when there is none at `deadline`.
  bool wait(MonotonicInstant deadline) {
    std::unique_lock lock(mutex_);
    // The steady_clock of libstdc++ is CLOCK_MONOTONIC, like Monotonic.
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
  /// Did the queue drop values within the last `recovery_time`, or is its backlog too old?
  bool behind(MonotonicInstant now) const {
    const std::lock_guard lock(mutex_);
    return is_behind(now);
  }

 private:
  bool is_behind(MonotonicInstant now) const {
    return (last_drop_ && now - *last_drop_ < options_.recovery_time) ||
           (backlog_since_ && now - *backlog_since_ >= options_.backlog_timeout);
  }
  void drop_oldest(MonotonicInstant now) {
    options_.on_drop(queue_.front());
    queue_.pop_front();
    ++dropped_;
    last_drop_ = now;
  }

  const Options options_;
  mutable std::mutex mutex_;  ///< guards the members below
  std::condition_variable filled_;
  std::deque<T> queue_;
  /// Since then values wait, at least `backlog_` of them; empty: none waited after the last pop().
  std::optional<MonotonicInstant> backlog_since_;
  size_t backlog_ = 0;
  std::optional<MonotonicInstant> last_drop_;
  int64_t dropped_ = 0;
};

/// How long an input queue has been idle, according to its reader. Messages that wait while the
/// reader is stopped do not count as idle time. Calls of the reader: one thread.
class QueueIdleTimer {
 public:
  /// The reader received a message.
  void on_received(MonotonicInstant now) { received_ = now; }
  /// The reader found the queue empty.
  void on_empty(MonotonicInstant now) { checked_ = now; }

  /// Had the reader received nothing for `time` when it last found the queue empty? Any thread.
  bool idle_for(Duration time) const {
    // Read in this order, so that a message received in between ends the idle time.
    const MonotonicInstant checked = checked_, received = received_;
    return checked - received >= time;
  }

 private:
  std::atomic<MonotonicInstant> received_ = Monotonic::now();
  std::atomic<MonotonicInstant> checked_ = MonotonicInstant();
};

}  // namespace v3d::recond
