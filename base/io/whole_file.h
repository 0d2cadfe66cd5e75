// Whole files for set-up and commands: the functions of base/io/file.h, with exceptions.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

namespace v3d {

/// io::read_file(). Throws InputError with path and cause.
std::string read_file(const std::filesystem::path& path);

/// Limit of a text file of a take: the largest, the ledger of a take with much missing, has some
/// MB.
inline constexpr uint64_t kMaxTakeTextBytes = 8 << 20;
/// A whole text file of a take (take.toml, calib.toml, ...). Throws InputError with path and cause
/// when it is not a regular file, a symbolic link, or longer than kMaxTakeTextBytes. The folder
/// may be reached by a link: operators move takes to another disk.
std::string read_take_file(const std::filesystem::path& path);

/// io::replace_file(). Throws std::runtime_error with path and cause.
void replace_file(const std::filesystem::path& path, std::string_view text);

}  // namespace v3d
