// Recovery of a mesh file that v3d-recond did not close.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace v3d::recond {

struct RecoveredMeshes {
  std::optional<int64_t> meshes;  ///< in the file; empty when it cannot be read
  bool is_whole = false;          ///< the file can be read and has its index
  /// For the operator: "57 meshes recovered"; otherwise with path and cause of what failed.
  std::string text;
};

/// Counts the meshes of a mesh.v3d and adds its index if it has none. Changes no other byte.
/// Reports its progress to systemd: the meshes of hours are read for minutes.
RecoveredMeshes recover_mesh_file(const std::filesystem::path& mesh);

}  // namespace v3d::recond
