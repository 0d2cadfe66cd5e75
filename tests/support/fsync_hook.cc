#include "support/fsync_hook.h"

#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <utility>

namespace v3d::test {
namespace {

std::atomic<FsyncHook*> current = nullptr;

}  // namespace

FsyncHook::FsyncHook() { current = this; }
FsyncHook::~FsyncHook() { current = nullptr; }

int FsyncHook::on_sync(int fd) {
  struct stat status {};
  fstat(fd, &status);
  std::unique_lock lock(mutex_);
  ++syncs_;
  thread_ = std::this_thread::get_id();
  bytes_ = status.st_size;
  changed_.notify_all();
  const bool is_released =
      changed_.wait_for(lock, std::chrono::seconds(10), [this] { return !holds_; });
  is_stuck_ = is_stuck_ || !is_released;
  const int error = std::exchange(error_, 0);
  if (error == 0) return static_cast<int>(syscall(SYS_fsync, fd));
  errno = error;
  return -1;
}

bool FsyncHook::wait_for(int syncs) {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, std::chrono::seconds(10), [&] { return syncs_ >= syncs; });
}

void FsyncHook::hold(bool holds) {
  const std::lock_guard lock(mutex_);
  holds_ = holds;
  changed_.notify_all();
}

void FsyncHook::fail_next(int error) {
  const std::lock_guard lock(mutex_);
  error_ = error;
}

bool FsyncHook::is_stuck() {
  const std::lock_guard lock(mutex_);
  return is_stuck_;
}

int FsyncHook::syncs() {
  const std::lock_guard lock(mutex_);
  return syncs_;
}

std::thread::id FsyncHook::thread() {
  const std::lock_guard lock(mutex_);
  return thread_;
}

long FsyncHook::bytes() {
  const std::lock_guard lock(mutex_);
  return bytes_;
}

}  // namespace v3d::test

/// Replaces fsync() of the C library in this program.
extern "C" int fsync(int fd) {
  v3d::test::FsyncHook* const hook = v3d::test::current;
  struct stat status {};
  const bool is_file = fstat(fd, &status) == 0 && S_ISREG(status.st_mode);
  return hook != nullptr && is_file ? hook->on_sync(fd) : static_cast<int>(syscall(SYS_fsync, fd));
}
