// Exclusive lock of a daemon on a folder (flock).
#pragma once

#include <filesystem>
#include <string>

#include "base/io/unique_fd.h"

namespace v3d {

/// Holds the lock file `folder`/`name`. The kernel releases it when the process ends, also when it
/// is killed. Any thread.
class FolderLock {
 public:
  /// Creates the folder if necessary. `owner` is written into the lock file, for the error message
  /// of other processes. Throws InputError when another process holds the lock, or the file cannot
  /// be opened.
  FolderLock(const std::filesystem::path& folder, const std::string& name,
             const std::string& owner);

 private:
  io::UniqueFd file_;
};

}  // namespace v3d
