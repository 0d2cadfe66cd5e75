// A disk that a test may fill, make read-only and take away. The test program is linked with
// v3d_test_network: mounts are its own.
#pragma once

#include <fcntl.h>
#include <sys/mount.h>
#include <unistd.h>

#include <filesystem>
#include <string>

namespace v3d::test {

class SmallDisk {
 public:
  /// Mounted on `folder`, which is made.
  SmallDisk(std::filesystem::path folder, int64_t bytes) : folder_(std::move(folder)) {
    std::filesystem::create_directories(folder_);
    const std::string options = "size=" + std::to_string(bytes);
    is_mounted_ = mount("tmpfs", folder_.c_str(), "tmpfs", 0, options.c_str()) == 0;
  }
  ~SmallDisk() { vanish(); }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;

  /// False where this system permits no mount.
  bool is_mounted() const { return is_mounted_; }
  int64_t free_bytes() const {
    return static_cast<int64_t>(std::filesystem::space(folder_).available);
  }
  /// Other files take room, until `bytes` are left.
  void leave(int64_t bytes) const {
    const std::filesystem::path filler = folder_ / "filler";
    const int fd = open(filler.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
    if (posix_fallocate(fd, 0, free_bytes() - bytes) != 0) is_mounted_ = false;
    close(fd);
  }
  /// Requires that nobody has a file of it open for writing.
  void become_read_only() const {
    is_mounted_ = mount(nullptr, folder_.c_str(), nullptr, MS_REMOUNT | MS_RDONLY, nullptr) == 0;
  }
  /// Open files live on, as on a disk that was unmounted lazily.
  void vanish() const { umount2(folder_.c_str(), MNT_DETACH); }

 private:
  const std::filesystem::path folder_;
  mutable bool is_mounted_ = false;
};

}  // namespace v3d::test
