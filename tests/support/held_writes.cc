#include "support/held_writes.h"

#include <dlfcn.h>
#include <sys/uio.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <string>

namespace v3d::test {
namespace {

std::atomic<HeldWrites*> current = nullptr;

bool is_sound(int fd) {
  const std::filesystem::path link = "/proc/self/fd/" + std::to_string(fd);
  return std::filesystem::read_symlink(link).extension() == ".wav";
}

}  // namespace

HeldWrites::HeldWrites() { current = this; }
HeldWrites::~HeldWrites() {
  current = nullptr;
  release();
}

void HeldWrites::on_write() {
  std::unique_lock lock(mutex_);
  ++waiting_;
  changed_.notify_all();
  changed_.wait(lock, [this] { return !holds_; });
  --waiting_;
  changed_.notify_all();
}

bool HeldWrites::wait_for_write() {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, std::chrono::minutes(1), [this] { return waiting_ > 0; });
}

void HeldWrites::release() {
  std::unique_lock lock(mutex_);
  holds_ = false;
  changed_.notify_all();
  changed_.wait(lock, [this] { return waiting_ == 0; });
}

}  // namespace v3d::test

/// Replaces pwritev() of the C library in this program.
extern "C" ssize_t pwritev(int fd, const iovec* parts, int count, off_t offset) {
  using Write = ssize_t(int, const iovec*, int, off_t);
  static auto* const next = reinterpret_cast<Write*>(dlsym(RTLD_NEXT, "pwritev"));
  v3d::test::HeldWrites* const held = v3d::test::current;
  if (held != nullptr && v3d::test::is_sound(fd)) held->on_write();
  return next(fd, parts, count, offset);
}
