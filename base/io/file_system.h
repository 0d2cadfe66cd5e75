// The file system that a folder lies on.
#pragma once

#include <filesystem>

#include "base/io/result.h"

namespace v3d::io {

/// Waits until the disk has everything that was written to the file system of `folder`, by other
/// programs, too (syncfs). Fails with path and cause.
[[nodiscard]] Status sync_file_system(const std::filesystem::path& folder);

}  // namespace v3d::io
