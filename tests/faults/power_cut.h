// Shuts down a mounted ext4 file system, as a power cut does.
#pragma once

#include <fcntl.h>
#include <linux/ioctl.h>
#include <sys/ioctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cstdint>

namespace v3d::test {

/// Stops all writes, of data and of the journal, to the disk of the file system that holds `path`.
/// Returns false and sets errno when it is not ext4. The fault injector, which calls it too, does
/// not intercept its calls.
inline bool shut_down(const char* path) {
  constexpr auto kShutdown = _IOR('X', 125, uint32_t);  // EXT4_IOC_SHUTDOWN
  const uint32_t no_flush_of_the_journal = 2;           // EXT4_GOING_FLAGS_NOLOGFLUSH
  const auto fd = static_cast<int>(syscall(SYS_openat, AT_FDCWD, path, O_RDONLY | O_CLOEXEC, 0));
  if (fd < 0) return false;
  const bool done = ioctl(fd, kShutdown, &no_flush_of_the_journal) == 0;
  close(fd);
  return done;
}

}  // namespace v3d::test
