// Operations on the file system that contains a folder.
#pragma once

#include <filesystem>

#include "base/io/result.h"

namespace v3d::io {

/// Waits until all data written to the file system of `folder`, also by other programs, are on the
/// disk (syncfs). Fails with path and cause.
[[nodiscard]] Status sync_file_system(const std::filesystem::path& folder);

}  // namespace v3d::io
