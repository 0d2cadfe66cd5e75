// mesh.v3d: compact frames one after the other, an index at the end. The index is rebuilt by
// scanning when the file was not closed. Layout in docs/compact-frame.md.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "take/log_opening.h"

namespace v3d {

class MeshFileWriter {
 public:
  /// To go on is to write behind the last whole mesh; what stands behind it is cut off. Throws
  /// InputError when the file cannot be written.
  explicit MeshFileWriter(const std::filesystem::path& path, LogOpening opening = LogOpening::kNew);
  ~MeshFileWriter();  ///< closes without throwing
  MeshFileWriter(MeshFileWriter&&) noexcept;

  /// Pulses must rise. False when the disk refused.
  bool append(int64_t pulse, std::span<const uint8_t> compact);
  /// Meshes in the file, and the pulse of the last.
  size_t size() const;
  std::optional<int64_t> last_pulse() const;
  /// Writes the index. False when the disk refused; the file stays readable.
  bool close();

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
