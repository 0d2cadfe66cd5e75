// Whole files for set-up and commands: the functions of base/io/file.h, with exceptions.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

namespace v3d {

/// io::read_file(). Throws InputError with path and cause.
std::string read_file(const std::filesystem::path& path);

/// io::replace_file(). Throws std::runtime_error with path and cause.
void replace_file(const std::filesystem::path& path, std::string_view text);

/// Memory that can be had without swapping (MemAvailable of /proc/meminfo), bytes.
int64_t available_memory();

}  // namespace v3d
