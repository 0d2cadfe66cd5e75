// Hash trees over the files of a take.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "base/io/result.h"
#include "take/take_files.h"

namespace v3d {

/// Returns false when a long computation is to end. Empty: never.
using MayContinue = std::function<bool()>;

/// Reads a file of a take and computes the root of its hash tree (wire/hash_tree.h).
///
/// The leaves of an event log (<camera>.lcmlog) are its events, from sync word to last byte. Where
/// no event starts, and in every other file, the leaves are blocks of 1 MiB.
///
/// `bytes`: the expected length. A file of another length is not read, and the result has no root.
/// `may_continue`: called before each MiB is read, and may block. When it returns false, the result
/// is the error ECANCELED.
/// Memory: 1 MiB. Fails with path and cause, also when the name is a symbolic link, and for a file
/// with large holes (SparseReader).
[[nodiscard]] io::Result<TakeFile> hash_take_file(const TakePaths& paths, const std::string& name,
                                                  int64_t bytes,
                                                  const MayContinue& may_continue = {});

}  // namespace v3d
