// Access to sparse files, whose holes use no disk space and read as zeros.
#pragma once

#include <cstdint>

#include "base/io/file.h"

namespace v3d {

/// Offset of the first byte from `offset` on that is not in a hole (lseek SEEK_DATA); the end of
/// the file if only a hole follows. Returns `offset` when the file system does not support holes.
///
/// The duration of a search depends on the amount of data, not on the length of the file. One
/// thread at a time for each file.
uint64_t next_data(const io::File& file, uint64_t offset);

}  // namespace v3d
