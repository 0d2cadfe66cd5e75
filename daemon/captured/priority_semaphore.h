// Priority semaphore: as many threads work at a time as there are cores, the oldest pulse first.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <map>
#include <mutex>

namespace v3d {

/// More workers at a time would only push each other out of the caches; and when all cameras have
/// a frame of a pulse, the set is complete soonest if nobody begins the next pulse before.
class PrioritySemaphore {
 public:
  explicit PrioritySemaphore(int places) : free_(places) {}

  /// Workers that wait for a place.
  size_t waiting() const {
    const std::lock_guard lock(mutex_);
    return waiting_.size();
  }

 private:
  friend class SemaphoreSlot;

  /// Waits for a place; the waiting thread with the lowest pulse gets the next one.
  void acquire(int64_t pulse) {
    std::unique_lock lock(mutex_);
    if (free_ > 0) {
      --free_;
      return;
    }
    Waiter self;
    waiting_.emplace(pulse, &self);
    self.turn.wait(lock, [&] { return self.has_place; });
  }

  void release() {
    const std::lock_guard lock(mutex_);
    if (waiting_.empty()) {
      ++free_;
      return;
    }
    Waiter& next = *waiting_.begin()->second;
    waiting_.erase(waiting_.begin());
    next.has_place = true;
    next.turn.notify_one();  // under the lock: the waiter lives on its thread's stack
  }

  struct Waiter {
    std::condition_variable turn;
    bool has_place = false;
  };
  mutable std::mutex mutex_;
  int free_;
  std::multimap<int64_t, Waiter*> waiting_;
};

/// A place, held from construction, which waits for it, to destruction.
class SemaphoreSlot {
 public:
  SemaphoreSlot(PrioritySemaphore& places, int64_t pulse) : places_(places) {
    places.acquire(pulse);
  }
  ~SemaphoreSlot() { places_.release(); }
  SemaphoreSlot(const SemaphoreSlot&) = delete;
  SemaphoreSlot& operator=(const SemaphoreSlot&) = delete;

 private:
  PrioritySemaphore& places_;
};

}  // namespace v3d
