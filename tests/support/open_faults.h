// Faults of open() and openat() of the C library, which open_faults.cc replaces in this program.
#pragma once

#include <atomic>
#include <filesystem>

namespace v3d::test {

/// Sets a flag during the lifetime of the object.
class FlagScope {
 public:
  explicit FlagScope(std::atomic<bool>& flag) : flag_(flag) { flag_ = true; }
  ~FlagScope() { flag_ = false; }
  FlagScope(const FlagScope&) = delete;
  FlagScope& operator=(const FlagScope&) = delete;

 private:
  std::atomic<bool>& flag_;
};

/// Opening any file or folder fails with EMFILE. RLIMIT_NOFILE is not used, because UBSan needs a
/// pipe to read the types of objects.
class NoDescriptorsLeft : FlagScope {
 public:
  NoDescriptorsLeft();
};

/// Creating a file below `folder` fails with ENOSPC, as on a disk without free inodes. Existing
/// files can be opened.
class FullDisk : FlagScope {
 public:
  explicit FullDisk(const std::filesystem::path& folder);
};

}  // namespace v3d::test
