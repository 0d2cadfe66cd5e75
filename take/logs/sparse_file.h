// Sparse files: holes take no space on the disk and read as zeros.
#pragma once

#include <cstdint>

#include "base/io/file.h"

namespace v3d {

/// The first byte from `offset` on that is not in a hole (lseek SEEK_DATA); the end of the file
/// where only a hole follows. `offset` itself where the file system does not know its holes.
/// Searching a file is then as fast as its data are few, whatever its length. One thread at a time
/// for each file.
uint64_t next_data(const io::File& file, uint64_t offset);

}  // namespace v3d
