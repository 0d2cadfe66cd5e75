// Reads and writes whole files in set-up code and commands: the functions of base/io/file.h, with
// exceptions.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

namespace v3d {

/// True when `path` names a file of any kind; symbolic links are followed. Throws InputError with
/// path and cause when this cannot be determined: no permission, a loop of links, a disk error.
bool file_exists(const std::filesystem::path& path);

/// Like io::read_file(). Throws InputError with path and cause.
std::string read_file(const std::filesystem::path& path);

/// Maximum length of a text file of a take, bytes. The longest is the ledger of a take with many
/// missing frames: some MB.
inline constexpr uint64_t kMaxTakeTextBytes = 8 << 20;
/// Reads a whole text file of a take (take.toml, calib.toml, ...).
/// Throws InputError with path and cause when it is not a regular file, is a symbolic link, or is
/// longer than kMaxTakeTextBytes. The path of its folder may contain symbolic links: operators move
/// takes to other disks.
std::string read_take_file(const std::filesystem::path& path);

/// Like io::replace_file(), for results of commands and set-up files. Throws InputError when `path`
/// is a recorded file (base/io/recorded_file.h), and std::runtime_error with path and cause when it
/// cannot be written. Code that owns a file of a take uses io::replace_file().
void replace_file(const std::filesystem::path& path, std::string_view text);

}  // namespace v3d
