// Checksums and hash trees of files of a take, computed by reading them.
#pragma once

#include <cstdint>
#include <functional>

#include "base/core/bytes.h"
#include "base/io/file.h"
#include "take/logs/log_files.h"
#include "wire/signatures.h"

namespace v3d::take {

/// The bytes from `begin` to before `end` of a file.
struct FileRange {
  uint64_t begin = 0;
  uint64_t end = 0;  ///< at most the length of the file
};

/// Returns false when a long computation is to end. Empty: never.
using MayContinue = std::function<bool()>;

// Both functions use 1 MiB of memory. They fail with path and cause, also for a file with large
// holes (SparseReader).

/// Adds the bytes to `sum`. `progress`: called before each MiB is read.
[[nodiscard]] io::Status add_to_checksum(const io::File& file, FileRange bytes,
                                         RunningChecksum& sum, const ReadProgress& progress = {});

/// Adds the leaves of the bytes to `tree`, the hash tree of the file (wire/signatures.h).
///
/// The leaves of an event log (<camera>.lcmlog) are its events, from sync word to last byte. Where
/// no event starts, and in every other file, the leaves are blocks of 1 MiB. `bytes` begin where a
/// leaf begins; an event that ends after them is none.
/// `may_continue`: called before each MiB is read, and may block. When it returns false, the result
/// is the error ECANCELED.
[[nodiscard]] io::Status add_to_tree(const io::File& file, FileRange bytes, wire::HashTree& tree,
                                     const MayContinue& may_continue = {});

}  // namespace v3d::take
