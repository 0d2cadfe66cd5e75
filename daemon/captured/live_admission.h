// Load control of the live picture.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>

namespace v3d::captured {

// Load shedding of the live picture: decides which pulses are published, once for all cameras of a
// node.

/// Recording has priority over the live picture: while frames queue up, pulses are only written. A
/// pulse is published by all cameras of the node or by none, because a frame set that lacks cameras
/// makes a bad mesh. Any thread.
class LiveAdmission {
 public:
  /// `backlog` returns the length of the longest frame queue of all cameras. Pulses whose first
  /// frame is processed while it exceeds `limit` are skipped.
  LiveAdmission(std::function<int64_t()> backlog, int64_t limit)
      : backlog_(std::move(backlog)), limit_(limit) {}

  /// Whether the pulse is published. The first call for a pulse decides.
  bool admits(int64_t pulse) {
    const std::lock_guard lock(mutex_);
    if (const auto known = decided_.find(pulse); known != decided_.end()) return known->second;
    const bool live = backlog_() <= limit_;
    decided_.emplace(pulse, live);
    if (!live) ++skipped_;
    if (decided_.size() > kMaxDecisions) decided_.erase(decided_.begin());
    return live;
  }
  /// The number of pulses skipped.
  int64_t skipped() const {
    const std::lock_guard lock(mutex_);
    return skipped_;
  }

 private:
  /// Decisions that are kept. Camera queues are shorter, so no older pulse is asked for.
  static constexpr size_t kMaxDecisions = 256;

  const std::function<int64_t()> backlog_;
  const int64_t limit_;
  mutable std::mutex mutex_;  ///< guards the members below
  std::map<int64_t, bool> decided_;
  int64_t skipped_ = 0;
};

// Counting semaphore whose waiting threads are served in order of pulse number, lowest first.

/// Limits segmentation to one thread per core; more would evict each other's data from the caches.
/// Serving the lowest pulse first completes frame sets soonest: when all cameras have a frame of a
/// pulse, none starts with the next pulse. Any thread. Acquire with SemaphoreSlot.
class PrioritySemaphore {
 public:
  explicit PrioritySemaphore(int slots) : free_(slots) {}

  /// The number of waiting threads.
  size_t waiting() const {
    const std::lock_guard lock(mutex_);
    return waiting_.size();
  }

 private:
  friend class SemaphoreSlot;

  /// Waits for a free slot.
  void acquire(int64_t pulse) {
    std::unique_lock lock(mutex_);
    if (free_ > 0) {
      --free_;
      return;
    }
    Waiter self;
    waiting_.emplace(pulse, &self);
    self.turn.wait(lock, [&] { return self.has_slot; });
  }

  void release() {
    const std::lock_guard lock(mutex_);
    if (waiting_.empty()) {
      ++free_;
      return;
    }
    Waiter& next = *waiting_.begin()->second;
    waiting_.erase(waiting_.begin());
    next.has_slot = true;
    next.turn.notify_one();  // under the lock: the Waiter is on the other thread's stack
  }

  struct Waiter {
    std::condition_variable turn;
    bool has_slot = false;
  };
  mutable std::mutex mutex_;
  int free_;
  std::multimap<int64_t, Waiter*> waiting_;  ///< by pulse
};

/// Acquires a slot in the constructor, which waits, and releases it in the destructor.
class SemaphoreSlot {
 public:
  SemaphoreSlot(PrioritySemaphore& slots, int64_t pulse) : slots_(slots) { slots.acquire(pulse); }
  ~SemaphoreSlot() { slots_.release(); }
  SemaphoreSlot(const SemaphoreSlot&) = delete;
  SemaphoreSlot& operator=(const SemaphoreSlot&) = delete;

 private:
  PrioritySemaphore& slots_;
};

}  // namespace v3d::captured
