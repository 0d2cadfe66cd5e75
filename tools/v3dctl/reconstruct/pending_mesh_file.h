// A mesh file under another name until it is whole.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "take/mesh_file.h"

namespace v3d::ctl {

/// One thread. What stood at its place stays until finish(); without that, nothing is left behind.
class PendingMeshFile {
 public:
  /// Throws InputError where the file cannot be made.
  explicit PendingMeshFile(const std::filesystem::path& place);
  ~PendingMeshFile();
  PendingMeshFile(const PendingMeshFile&) = delete;
  PendingMeshFile& operator=(const PendingMeshFile&) = delete;

  /// Pulses rise. Throws std::runtime_error with path and cause when the disk reports an error; so
  /// does finish().
  void append(int64_t pulse, const std::vector<uint8_t>& compact);
  /// On the disk, and in its place.
  void finish();

 private:
  std::filesystem::path place_;
  std::filesystem::path path_;
  MeshFileWriter file_;
  bool moved_ = false;
};

}  // namespace v3d::ctl
