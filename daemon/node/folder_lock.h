// A folder that belongs to one daemon.
#pragma once

#include <filesystem>
#include <string>

namespace v3d {

/// As long as it lives, nobody else claims the folder under this name; a daemon that is killed
/// leaves no claim behind. Any thread.
class FolderLock {
 public:
  /// Makes the folder where there is none. Throws InputError when another process has claimed it;
  /// `who` is told to it.
  FolderLock(const std::filesystem::path& folder, const std::string& name, const std::string& who);
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  int file_ = -1;
};

}  // namespace v3d
