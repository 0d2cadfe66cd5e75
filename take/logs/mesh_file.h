// mesh.v3d: a sequence of compact frames, with an index at the end (docs/compact-frame.md). If the
// file was not closed, readers rebuild the index by scanning.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/io/file.h"
#include "take/logs/log_files.h"

namespace v3d::take {

/// A mesh as it is in the file.
struct MeshRecord {
  std::vector<uint8_t> compact;
  uint32_t checksum = 0;  ///< CRC-32 of the compact frame that was written

  /// False when the disk has changed the bytes.
  bool is_intact() const;
};

/// Appends meshes to mesh.v3d. A separate thread syncs the file once a second during appends, so
/// that a power cut loses at most the meshes of the last second; append() does not wait for it. One
/// writing thread.
class MeshFileWriter {
 public:
  /// kNew creates the file and fails when the name exists. kContinue appends after the last byte of
  /// an existing file, changes none of its bytes, and creates the file if it does not exist. Header
  /// and name of a new file are on the disk when the constructor returns. Throws InputError when
  /// the file cannot be created, opened or read, or is no mesh file; std::runtime_error for errors
  /// of the disk. `progress` is called while a file without an index is read, which needs minutes.
  explicit MeshFileWriter(const std::filesystem::path& path, LogOpening opening = LogOpening::kNew,
                          const ReadProgress& progress = {});
  ~MeshFileWriter();  ///< calls close() and ignores its errors
  MeshFileWriter(MeshFileWriter&&) noexcept;

  /// Appends one mesh. Requires ascending pulses. Fails when the disk reports an error; the mesh is
  /// then not in the file, but a later one may succeed. Fails once after the disk lost meshes that
  /// it had accepted; sync() and close() then fail, too.
  [[nodiscard]] io::Status append(int64_t pulse, std::span<const uint8_t> compact);
  /// Appends a record of another file. A damaged one stays damaged, so that readers still find it.
  [[nodiscard]] io::Status append(int64_t pulse, const MeshRecord& record);
  /// Number of meshes in the file, and the pulse of the last one.
  size_t size() const;
  std::optional<int64_t> last_pulse() const;
  /// Waits until all meshes are on disk. Must not be called after close().
  [[nodiscard]] io::Status sync();
  /// Writes the index and waits until it is on disk. After a failure the file is still readable.
  [[nodiscard]] io::Status close();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

class MeshFileReader {
 public:
  /// Throws InputError when the file cannot be opened or its index cannot be read, and when it is
  /// not a mesh file. `progress` is called while a file without an index is read.
  explicit MeshFileReader(const std::filesystem::path& path, const ReadProgress& progress = {});
  ~MeshFileReader();
  MeshFileReader(MeshFileReader&&) noexcept;

  const std::vector<int64_t>& pulses() const;
  bool index_was_rebuilt() const;
  /// The compact frame of `pulse`; empty when there is none, its checksum is wrong, or the record
  /// holds the frame of another pulse. Fails with path and cause when the disk cannot read it.
  [[nodiscard]] io::Result<std::optional<std::vector<uint8_t>>> read(int64_t pulse);
  /// The record of `pulse`, also a damaged one. Requires one of pulses(). Fails as read().
  [[nodiscard]] io::Result<MeshRecord> read_record(int64_t pulse);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace v3d::take
