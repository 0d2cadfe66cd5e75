// Mesh files of a take that get their names when they are complete.
#pragma once

#include <sys/stat.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "take/logs/mesh_file.h"
#include "take/take.h"

namespace v3d::ctl {

/// State of a file, to detect that another program writes or replaces it.
class FileVersion {
 public:
  /// Throws InputError when the file cannot be read.
  explicit FileVersion(std::filesystem::path path);
  /// Throws InputError when the file is another one, or was written, since the construction.
  void require_unchanged() const;

 private:
  std::filesystem::path path_;
  struct stat status_ {};
};

/// Throws InputError for a mesh file without an index: `meshes` of the file `path`. A copy of it
/// would have an index, and the meshes that it lost would be missing without a sign.
void require_finished(const take::MeshFileReader& meshes, const std::filesystem::path& path);

/// Mesh file with a hidden temporary name until finish(), `.mesh.v3d.partial-<host>-<process>`. The
/// destructor removes an unfinished file. One thread.
class PendingMeshFile {
 public:
  /// `path`: the final path. Removes the unfinished files that killed processes of this host left
  /// behind. Throws as take::MeshFileWriter; then no file is left.
  explicit PendingMeshFile(const std::filesystem::path& path);
  ~PendingMeshFile();
  PendingMeshFile(const PendingMeshFile&) = delete;
  PendingMeshFile& operator=(const PendingMeshFile&) = delete;

  /// Requires increasing pulses. Throws std::runtime_error with path and cause for errors of the
  /// disk.
  void append(int64_t pulse, const std::vector<uint8_t>& compact);
  /// Appends a record of another file unchanged, also a damaged one. Otherwise as above.
  void append(int64_t pulse, const take::MeshRecord& record);
  /// Writes the index and syncs the file; append() must not follow. Throws as append().
  void close();
  /// True when the file of the final path has the same bytes; false when one of them cannot be
  /// read. Requires close().
  bool has_bytes_of_earlier() const;
  /// close() and renames the file. Throws as append().
  void finish();
  /// finish() for meshes that were made of the file of the final path. Throws InputError when that
  /// file is no longer `source`: v3d-recond may be writing it. Otherwise throws as append().
  void finish(const FileVersion& source);

 private:
  std::filesystem::path path_;
  std::filesystem::path temporary_path_;
  take::MeshFileWriter file_;
  bool finished_ = false;
};

/// A mesh file and, on request, its proxy: the same pulses with coarser voxels. One thread.
struct PendingMeshes {
  /// Final paths; `proxy_path` empty: no proxy. Throws as PendingMeshFile.
  PendingMeshes(const std::filesystem::path& master_path,
                const std::optional<std::filesystem::path>& proxy_path);

  /// Both files are closed before one is renamed. Throws as PendingMeshFile.
  void finish();

  PendingMeshFile master;
  std::optional<PendingMeshFile> proxy;
};

/// finish() for mesh.v3d and proxy.v3d of `take`.
///
/// Before mesh.v3d is replaced, so that an interruption leaves no results of other meshes: removes
/// the earlier proxy, and gives motion.v3d the next free name of earlier_motion(), because tracking
/// takes hours. motion.v3d stays where mesh.v3d stays the same to the byte. Reports on stderr a
/// proxy that has no successor, and the new name of motion.v3d. Throws std::runtime_error for
/// errors of the disk.
void replace_meshes(PendingMeshes& meshes, const take::TakePaths& take);

/// Suffix of temporary names: host and process.
std::string process_suffix();

}  // namespace v3d::ctl
