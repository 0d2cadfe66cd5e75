// mesh.v3d: compact frames one after the other, an index at the end. The index is rebuilt by
// scanning when the file was not closed. Layout in docs/compact-frame.md.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/io/result.h"
#include "take/logs/log_opening.h"

namespace v3d {

/// A thread of its own syncs the file once a second while meshes are appended, so that a power cut
/// loses at most the meshes of the last second; append() does not wait for it. One thread.
class MeshFileWriter {
 public:
  /// kNew creates the file and fails when the name is taken. kGoOn appends behind the last byte of
  /// an existing file, changes none of its bytes, and creates it where there is none. Throws
  /// InputError when the file cannot be created, opened, read or is no mesh file.
  explicit MeshFileWriter(const std::filesystem::path& path, LogOpening opening = LogOpening::kNew);
  ~MeshFileWriter();  ///< closes without throwing
  MeshFileWriter(MeshFileWriter&&) noexcept;

  /// Pulses must rise. Fails when the disk reports an error; the mesh is then not in the file, and
  /// a later one may be. Fails once after the disk has lost meshes that it had accepted; sync() and
  /// close() then fail, too.
  [[nodiscard]] io::Status append(int64_t pulse, std::span<const uint8_t> compact);
  /// Meshes in the file, and the pulse of the last.
  size_t size() const;
  std::optional<int64_t> last_pulse() const;
  /// Waits until the disk has every mesh. Not after close().
  [[nodiscard]] io::Status sync();
  /// Writes the index and waits for the disk. After a failure the file stays readable.
  io::Status close();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

class MeshFileReader {
 public:
  explicit MeshFileReader(const std::filesystem::path& path);  ///< throws InputError
  ~MeshFileReader();
  MeshFileReader(MeshFileReader&&) noexcept;

  const std::vector<int64_t>& pulses() const;
  bool index_was_rebuilt() const;
  /// The compact frame of a pulse; empty when there is none or its checksum is wrong.
  std::optional<std::vector<uint8_t>> read(int64_t pulse);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace v3d
