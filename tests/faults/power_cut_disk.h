// Ext4 file system in a file, mounted by a loop device, with simulated power cuts. Needs root.
#pragma once

#include <filesystem>
#include <string>

namespace v3d::test {

/// Gives this process and its children their own mounts, which end with them. Returns why this is
/// not possible (no root, no namespace, no loop device), or an empty string.
std::string create_mount_namespace();

/// A power cut is EXT4_IOC_SHUTDOWN without a flush of the journal: no later write reaches the
/// disk. The page cache and the running transaction are lost; the next mount replays the journal.
class PowerCutDisk {
 public:
  /// `files`: a folder for the disk's content; `place`: an empty folder to mount it at.
  /// This and the functions below throw std::runtime_error when a command fails.
  PowerCutDisk(std::filesystem::path files, std::filesystem::path place);
  ~PowerCutDisk();
  PowerCutDisk(const PowerCutDisk&) = delete;
  PowerCutDisk& operator=(const PowerCutDisk&) = delete;

  /// Saves the present content of the disk for restore().
  void save();
  /// Mounts a disk with the saved content.
  void restore();
  /// Cuts the power. A fault of the kind POWER_CUT (fault_plan.h) does the same in a program and
  /// kills it.
  void cut_power() const;
  /// Mounts the disk again, as a PC does when it starts.
  void restart();

 private:
  void mount() const;
  void unmount() const;
  std::filesystem::path image(int number) const;

  const std::filesystem::path files_, place_;
  int number_ = 0;  ///< of the mounted file; each number is used once
};

}  // namespace v3d::test
