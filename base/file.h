// Whole files, read and replaced in one step.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

namespace v3d {

/// Throws InputError naming the file when it cannot be read.
std::string read_file(const std::filesystem::path& path);

/// Readers see the old text or the new, never a part; after return it survives a power cut
/// (temporary file, fsync, rename, fsync of the folder). Throws std::runtime_error with the path
/// and the cause.
void replace_file(const std::filesystem::path& path, std::string_view text);

/// Memory that can be had without swapping (MemAvailable of /proc/meminfo), bytes.
int64_t available_memory();

}  // namespace v3d
