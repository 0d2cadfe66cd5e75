// Access to sparse files, whose holes use no disk space and read as zeros.
#pragma once

#include <cstdint>
#include <span>

#include "base/io/file.h"

namespace v3d {

/// Offset of the first byte from `offset` on that is not in a hole (lseek SEEK_DATA); the end of
/// the file if only a hole follows. Returns `offset` when the file system does not support holes.
///
/// The duration of a search depends on the amount of data, not on the length of the file. One
/// thread at a time for each file.
uint64_t next_data(const io::File& file, uint64_t offset);

/// Reads a whole file in ascending order without reading its holes, for checksums: a file of any
/// length that takes little room on the disk is read, or rejected, in seconds. One thread.
class SparseReader {
 public:
  /// Limit of the bytes in holes. V3D writes no holes; copies by other programs may have some where
  /// the original has zeros.
  static constexpr uint64_t kMaxHoleBytes = uint64_t{16} << 30;

  /// `file` must outlive the object.
  explicit SparseReader(const io::File& file) : file_(file) {}

  /// Like io::File::read_whole(), with offsets that do not descend. Bytes in holes are zeros. Fails
  /// with EFBIG when the holes up to here have more than kMaxHoleBytes.
  [[nodiscard]] io::Status read_whole(uint64_t offset, std::span<uint8_t> bytes);

 private:
  const io::File& file_;
  uint64_t hole_end_ = 0;  ///< end of the last hole that was found
  uint64_t holes_ = 0;     ///< bytes in holes before hole_end_
};

}  // namespace v3d
