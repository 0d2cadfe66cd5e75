// Locks of takes, against other processes and other PCs.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "base/io/file.h"
#include "base/io/unique_fd.h"
#include "take/take.h"

namespace v3d::take {

// TakeLock: exclusive right of one process to record into a take as one node, or to recover it.

/// Holds flock() on `.<node>.lock` in the take folder for the lifetime of the object. The kernel
/// releases the lock when the process ends. Move only. Thread-safe.
///
/// Over NFS, the Linux client maps flock() to a lock of the server, so it also excludes other PCs,
/// but not a process on the server itself, which locks the file locally.
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

/// True for the error of a lock file that could not be created on a full disk (ENOSPC, EDQUOT).
bool is_of_full_disk(const io::IoError& error);

// DeletionLock: exclusive right of one process to delete a take, or to need it as the copy of a
// take that it deletes.

/// Holds the file `.deletion` in the take folder, which it has created (O_EXCL), for the lifetime
/// of the object. This excludes other PCs on every file system, also an NFS client and its server.
/// Move only.
///
/// A process that is killed leaves its file. A later process on the same PC takes it over before
/// the next start of the PC. Otherwise a person removes it, because nothing shows that its holder
/// on another PC has ended.
class DeletionLock {
 public:
  /// Requires that the take folder exists. Fails with EEXIST, path and holder while another process
  /// has the lock, with EDEADLK when this process has it, perhaps by another path, and with ENOSPC
  /// or EDQUOT when the disk has no room for the file. Where this process may not write the file
  /// (no permission, a read-only file system), the object excludes no other process, but acquire()
  /// fails while another process has the lock.
  [[nodiscard]] static io::Result<DeletionLock> acquire(const TakePaths& paths);
  /// Removes the file, unless another file has its name.
  ~DeletionLock();
  DeletionLock(DeletionLock&&) noexcept = default;
  DeletionLock& operator=(DeletionLock&&) = delete;

  /// True when the lock excludes other processes.
  bool excludes() const { return static_cast<bool>(fd_); }

 private:
  DeletionLock(std::filesystem::path path, io::UniqueFd fd)
      : path_(std::move(path)), fd_(std::move(fd)) {}

  std::filesystem::path path_;
  io::UniqueFd fd_;
};

}  // namespace v3d::take
