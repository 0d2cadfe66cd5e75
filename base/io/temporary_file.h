// Temporary files that replace others atomically.
#pragma once

#include <filesystem>

#include "base/io/file.h"

namespace v3d::io {

/// Creates a new file beside `path`, with a name for which is_temporary() is true. Tries further
/// names when a file of an earlier process with the same process id remains.
[[nodiscard]] Result<File> create_temporary(const std::filesystem::path& path);

/// Syncs the written file and renames it to `path`; removes it after any failure, also an earlier
/// one in `status`. The new name is on the disk only after sync_folder().
[[nodiscard]] Status sync_and_rename(File file, Status status, const std::filesystem::path& path);

}  // namespace v3d::io
