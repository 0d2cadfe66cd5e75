#include "take/logs/periodic_sync.h"

#include <cerrno>
#include <utility>

namespace v3d {
namespace {

/// The first multiple of `period` after `now`.
MonotonicInstant next_period(MonotonicInstant now, Duration period) {
  return now - now.time_since_epoch() % period + period;
}

}  // namespace

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

io::Status PeriodicSync::sync() {
  sync_file();
  return pop_error();
}

void PeriodicSync::run() {
  MonotonicInstant next = next_period(Monotonic::now(), period_);
  while (wait_until(next)) {
    next = next_period(Monotonic::now(), period_);  // before the sync, which may take long
    bool is_due = false;
    {
      const std::lock_guard lock(mutex_);
      is_due = is_dirty_;
    }
    if (is_due) sync_file();
  }
}

/// False when the object is being destroyed.
bool PeriodicSync::wait_until(MonotonicInstant instant) {
  std::unique_lock lock(mutex_);
  return !stopped_.wait_for(lock, instant - Monotonic::now(), [this] { return stopping_; });
}

/// Syncs the file and stores the first error.
void PeriodicSync::sync_file() {
  const std::lock_guard syncing(sync_mutex_);
  {
    const std::lock_guard lock(mutex_);
    is_dirty_ = false;
  }
  io::Status synced = file_.sync();
  if (synced || is_unsupported_sync(synced.error().code)) return;
  const std::lock_guard lock(mutex_);
  if (failure_) failure_ = std::move(synced);
}

bool is_unsupported_sync(int error) {
  return error == EINVAL || error == ENOSYS || error == EOPNOTSUPP;
}

}  // namespace v3d
