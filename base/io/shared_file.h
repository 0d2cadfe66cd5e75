// Files that people and several programs change, such as the studio file.
#pragma once

#include <filesystem>
#include <functional>
#include <string_view>

#include "base/io/file.h"

namespace v3d::io {

/// Exclusive lock (flock) on a folder. It ends with the result. While one call has it, others wait
/// for it, also those of other processes; each calls `on_wait` once before it waits.
///
/// Over NFS, the lock excludes only calls on this PC. Fails with path and cause when the folder
/// cannot be opened, or its file system has no locks.
[[nodiscard]] Result<UniqueFd> lock_folder(
    const std::filesystem::path& folder, const std::function<void()>& on_wait = [] {});

}  // namespace v3d::io

namespace v3d {

/// Like replace_file(), for a file that people maintain: a symbolic link stays, and the file
/// that it names is replaced. The new file has the mode of the old one, and its owner and group
/// where this process may set them. Throws what replace_file() throws.
void update_file(const std::filesystem::path& path, std::string_view text);

}  // namespace v3d
