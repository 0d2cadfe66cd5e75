// TakeLock: exclusive right of one process to record into a take as one node, or to recover it.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/io/file.h"
#include "base/io/unique_fd.h"
#include "take/take.h"

namespace v3d::take {

/// Holds flock() on `.<node>.lock` in the take folder for the lifetime of the object. The kernel
/// releases the lock when the process ends. Move only. Thread-safe.
///
/// Over NFS, the Linux client maps flock() to a lock of the server, so it also excludes other PCs.
/// After a crash of a PC, its lock stays until the server's lease ends (usually 90 s). Where the
/// file system does not support locks (ENOLCK, EOPNOTSUPP, ENOSYS), acquire() succeeds without
/// exclusion and excludes() is false.
class TakeLock {
 public:
  /// Acquires the lock of `node`. Requires that the take folder exists. Fails with EWOULDBLOCK and
  /// the name of the holder while another process holds the lock, and with another error when the
  /// lock file cannot be created.
  [[nodiscard]] static io::Result<TakeLock> acquire(const TakePaths& paths,
                                                    const std::string& node);
  /// Removes the lock file, unless another file has its name, then releases the lock.
  ~TakeLock();
  TakeLock(TakeLock&&) noexcept = default;
  TakeLock& operator=(TakeLock&&) = delete;

  /// True when the lock excludes other processes.
  bool excludes() const { return excludes_; }

 private:
  TakeLock(std::filesystem::path path, io::UniqueFd fd, bool excludes)
      : path_(std::move(path)), fd_(std::move(fd)), excludes_(excludes) {}

  std::filesystem::path path_;
  io::UniqueFd fd_;
  bool excludes_ = false;
};

/// The process that holds a lock of any node on this take: "process 812 on cap01". Empty when none
/// does. Fails with path and cause when the folder or a lock file cannot be read: then a process
/// may hold a lock.
[[nodiscard]] io::Result<std::string> take_lock_holder(const TakePaths& paths);

/// Acquires the locks of all nodes that may record into the take: those in its studio file, and
/// those that have a lock file. Used by programs that are no node. Fails as TakeLock::acquire()
/// does, also when the folder cannot be listed; then it holds no lock.
[[nodiscard]] io::Result<std::vector<TakeLock>> lock_whole_take(const TakePaths& paths);

}  // namespace v3d::take
