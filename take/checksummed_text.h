// Text files with a checksum of their own: ledger.toml, and the indexes of log segments.
//
// The first line is xxh3 = '<XXH3 of all following bytes>', a valid line of TOML.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "base/config/toml_file.h"

namespace v3d {

/// `content` below the line with its checksum.
std::string with_checksum(std::string_view content);

/// Parses a file that with_checksum() made, or one of an earlier version without that line. Throws
/// InputError when the checksum is wrong, and as TomlTable::parse() does.
TomlTable parse_checksummed(std::string_view text, const std::filesystem::path& path);

}  // namespace v3d
