#include "take/logs/periodic_sync.h"

#include <utility>

namespace v3d {

PeriodicSync::PeriodicSync(const io::File& file, Duration period)
    : file_(file), period_(period), thread_([this] { run(); }) {}

PeriodicSync::~PeriodicSync() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  stopped_.notify_one();
  thread_.join();
}

void PeriodicSync::mark_dirty() {
  const std::lock_guard lock(mutex_);
  is_dirty_ = true;
}

io::Status PeriodicSync::pop_error() {
  const std::lock_guard lock(mutex_);
  return std::exchange(failure_, io::Status());
}

void PeriodicSync::run() {
  std::unique_lock lock(mutex_);
  while (!stopped_.wait_for(lock, period_, [this] { return stopping_; })) {
    if (!std::exchange(is_dirty_, false)) continue;
    lock.unlock();
    io::Status synced = file_.sync();
    lock.lock();
    if (!synced && failure_) failure_ = std::move(synced);
  }
}

}  // namespace v3d
