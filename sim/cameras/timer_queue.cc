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
