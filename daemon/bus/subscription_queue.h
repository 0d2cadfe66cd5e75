// Queue of a subscription, and the count of its lost messages.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "base/core/time.h"

namespace v3d::bus {

// A queue between threads with a size limit. A push to a full queue drops and counts the oldest
// element.

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

// Counts lost messages by their sequence numbers, because LCM has no loss counter.

/// Counts of the messages of one sender on one channel.
struct SequenceCounts {
  int64_t received = 0;   ///< each message once
  int64_t lost = 0;       ///< sent before the newest arrived message, and not received
  int64_t late = 0;       ///< of `received`: arrived after a newer message
  int64_t duplicate = 0;  ///< received again

  SequenceCounts& operator+=(const SequenceCounts& other);
  friend bool operator==(const SequenceCounts&, const SequenceCounts&) = default;
};

/// Detects lost, late and duplicate messages of many senders. One thread.
class SequenceTracker {
 public:
  /// `from_start`: reception starts before each sender's first message, which has the number 0.
  /// Messages before the first arrived one then count as lost too.
  explicit SequenceTracker(bool from_start = false) : from_start_(from_start) {}

  /// Records a message of the sender `key` at its arrival. `seq` is 0 or more; `sent` is a time of
  /// the sender's clock. A number that does not increase shows a restart of the sender when the
  /// message was sent later than the newest one, or at least 10 s earlier.
  void note(const std::string& key, int64_t seq, RealtimeInstant sent);

  /// Starts a new count for `key`: messages that were sent before this call do not count as lost.
  void start_new_count(const std::string& key);

  /// The counts of one key; total() is the sum over all keys.
  SequenceCounts of(const std::string& key) const;
  const SequenceCounts& total() const { return total_; }

 private:
  /// Limits against invented channels and numbers: of keys, of lost messages in one gap, and of
  /// missing numbers that are stored for a key.
  static constexpr size_t kMaxKeys = 1024;
  static constexpr int64_t kMaxMissed = 1'000'000;
  static constexpr int64_t kMaxMissingNumbers = 4096;

  struct Sender {
    int64_t newest = -1;
    RealtimeInstant newest_sent = {};
    std::set<int64_t> missing = {};  ///< numbers below the newest that have not arrived
    SequenceCounts counts = {};
    bool from_start = false;  ///< as in the constructor
  };
  /// The change of the counts by this message.
  SequenceCounts arrived(Sender& sender, int64_t seq, RealtimeInstant sent) const;

  const bool from_start_;
  std::map<std::string, Sender> senders_;
  SequenceCounts total_;
};

}  // namespace v3d::bus
