// An ext4 file system whose power can be cut: a file, mounted by a loop device. Needs root.
#pragma once

#include <filesystem>
#include <string>

namespace v3d::test {

/// From now on this process and its children see mounts of their own, which end with them. Returns
/// why it is not possible here (no root, no loop device, no ext4), or nothing.
std::string begin_own_mounts();

/// A power cut is EXT4_IOC_SHUTDOWN without a flush of the journal: from that moment nothing more
/// reaches the disk. What the page cache and the running transaction hold is lost; the next mount
/// replays the journal.
class PowerCutDisk {
 public:
  /// `files`: a folder for the disk's content; `place`: an empty folder to mount it at.
  /// Throws std::runtime_error when a command fails, as the functions below do.
  PowerCutDisk(std::filesystem::path files, std::filesystem::path place);
  ~PowerCutDisk();
  PowerCutDisk(const PowerCutDisk&) = delete;
  PowerCutDisk& operator=(const PowerCutDisk&) = delete;

  /// What the disk holds now is what begin_again() begins with.
  void keep();
  void begin_again();
  /// Also done by a program with a fault of the kind POWER_CUT (fault_plan.h), which ends with it.
  void cut_power() const;
  /// The PC is switched on again.
  void restart();

 private:
  void mount() const;
  void unmount() const;
  std::filesystem::path image(int number) const;

  const std::filesystem::path files_, place_;
  int number_ = 0;  ///< of the file that is mounted; each is used once
};

}  // namespace v3d::test
