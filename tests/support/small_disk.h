// A small disk (tmpfs) that a test can fill, remount read-only and detach. The test program is
// linked with v3d_test_network, so its mounts are private.
#pragma once

#include <fcntl.h>
#include <sys/mount.h>
#include <unistd.h>

#include <filesystem>
#include <string>

namespace v3d::test {

class SmallDisk {
 public:
  /// Creates `folder` and mounts a tmpfs of `bytes` bytes on it.
  SmallDisk(std::filesystem::path folder, int64_t bytes) : folder_(std::move(folder)) {
    std::filesystem::create_directories(folder_);
    const std::string options = "size=" + std::to_string(bytes);
    is_mounted_ = mount("tmpfs", folder_.c_str(), "tmpfs", 0, options.c_str()) == 0;
  }
  ~SmallDisk() { vanish(); }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;

  /// False when this system does not permit the mount, or a later change failed.
  bool is_mounted() const { return is_mounted_; }
  int64_t free_bytes() const {
    return static_cast<int64_t>(std::filesystem::space(folder_).available);
  }
  /// Fills the disk with a file until `bytes` bytes are free.
  void leave(int64_t bytes) const {
    const std::filesystem::path filler = folder_ / "filler";
    const int fd = ::open(filler.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
    if (posix_fallocate(fd, 0, free_bytes() - bytes) != 0) is_mounted_ = false;
    ::close(fd);
  }
  /// Precondition: no file of the disk is open for writing.
  void become_read_only() const {
    is_mounted_ = mount(nullptr, folder_.c_str(), nullptr, MS_REMOUNT | MS_RDONLY, nullptr) == 0;
  }
  /// Detaches the disk. Open files stay usable, as after a lazy unmount.
  void vanish() const { umount2(folder_.c_str(), MNT_DETACH); }

 private:
  const std::filesystem::path folder_;
  mutable bool is_mounted_ = false;
};

}  // namespace v3d::test
