// Owned file descriptors, and system calls that are repeated after a signal (EINTR).
#pragma once

#include <unistd.h>

#include <cerrno>
#include <system_error>
#include <utility>

namespace v3d::io {

// UniqueFd: a file descriptor with one owner.

/// Closes the descriptor when it is destroyed. -1 means that it owns none. Move only.
class UniqueFd {
 public:
  UniqueFd() = default;
  explicit UniqueFd(int fd) : fd_(fd) {}
  ~UniqueFd() { reset(); }
  UniqueFd(UniqueFd&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  UniqueFd& operator=(UniqueFd&& other) noexcept {
    if (this != &other) reset(std::exchange(other.fd_, -1));
    return *this;
  }
  UniqueFd(const UniqueFd&) = delete;
  UniqueFd& operator=(const UniqueFd&) = delete;

  int get() const { return fd_; }
  explicit operator bool() const { return fd_ >= 0; }
  /// Gives up ownership; the caller closes the descriptor.
  int release() { return std::exchange(fd_, -1); }
  /// Closes the descriptor and owns `fd` instead.
  void reset(int fd = -1) {
    if (fd_ >= 0) close(fd_);
    fd_ = fd;
  }

 private:
  int fd_ = -1;
};

// Repeats a system call that a signal interrupted (EINTR).

/// Repeats `call` until it returns another result than EINTR, and returns that result. `call`
/// returns a negative value and sets errno when it fails.
template <class Call>
auto uninterrupted(Call call) {
  auto result = call();
  while (result < 0 && errno == EINTR) result = call();
  return result;
}

/// Like uninterrupted(), for a call that sets an std::error_code. Returns the code.
template <class Call>
std::error_code uninterrupted_code(Call call) {
  std::error_code code;
  do {
    code.clear();
    call(code);
  } while (code == std::errc::interrupted);
  return code;
}

}  // namespace v3d::io
