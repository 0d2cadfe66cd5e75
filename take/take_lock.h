// TakeLock: the right of one process to record into a take as one node, or to recover it.
#pragma once

#include <filesystem>
#include <string>

#include "base/io/result.h"
#include "base/io/unique_fd.h"
#include "take/take.h"

namespace v3d {

/// flock() on `.<node>.lock` in the folder of the take, held as long as the object lives. A process
/// that dies releases it. Move only; any thread.
///
/// Over NFS the Linux client makes of flock() a lock of the server, so that it also excludes other
/// PCs; a PC that crashes holds it until the server's lease ends (90 s as a rule). Where the file
/// system knows no locks (ENOLCK, EOPNOTSUPP, ENOSYS) the lock is granted without exclusion, and
/// excludes() is false.
class TakeLock {
 public:
  /// Requires the folder of the take. Fails with EWOULDBLOCK while another process holds the lock,
  /// and names it; with another error when the lock file cannot be made.
  [[nodiscard]] static io::Result<TakeLock> acquire(const TakePaths& paths,
                                                    const std::string& node);
  /// Removes the lock file, and then releases the lock.
  ~TakeLock();
  TakeLock(TakeLock&&) noexcept = default;
  TakeLock& operator=(TakeLock&&) = delete;

  /// Whether others are kept out.
  bool excludes() const { return excludes_; }

 private:
  TakeLock(std::filesystem::path path, io::UniqueFd fd, bool excludes)
      : path_(std::move(path)), fd_(std::move(fd)), excludes_(excludes) {}

  std::filesystem::path path_;
  io::UniqueFd fd_;
  bool excludes_ = false;
};

/// Who holds a lock of any node on this take: "process 812 on cap01"; empty when nobody does.
std::string recorder_of(const TakePaths& paths);

}  // namespace v3d
