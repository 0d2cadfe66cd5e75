#include "sim/cameras/timer_queue.h"

#include <utility>

namespace v3d::sim {

TimerQueue::TimerQueue() : thread_([this] { run(); }) {}

void TimerQueue::end() {
  {
    const std::lock_guard lock(mutex_);
    quit_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void TimerQueue::at(MonotonicInstant due, std::function<void()> thing) {
  {
    const std::lock_guard lock(mutex_);
    things_.emplace(due, std::move(thing));
  }
  changed_.notify_all();
}

void TimerQueue::run() {
  std::unique_lock lock(mutex_);
  while (!quit_) {
    if (things_.empty()) {
      changed_.wait(lock);
      continue;
    }
    const auto first = things_.begin();
    if (const Duration left = first->first - Monotonic::now(); left > Duration::zero()) {
      changed_.wait_for(lock, left);
      continue;
    }
    const std::function<void()> thing = std::move(first->second);
    things_.erase(first);
    lock.unlock();
    thing();
    lock.lock();
  }
}

}  // namespace v3d::sim
