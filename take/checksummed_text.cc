#include "take/checksummed_text.h"

#include <algorithm>
#include <span>

#include "base/core/checksum.h"
#include "base/core/error.h"
#include "take/take_files.h"

namespace v3d {
namespace {

constexpr std::string_view kKey = "xxh3";

std::string checksum_line(std::string_view content) {
  const std::span bytes(reinterpret_cast<const uint8_t*>(content.data()), content.size());
  return std::string(kKey) + " = " + toml_string(checksum_text(checksum({bytes}))) + "\n";
}

/// Throws InputError when the text has a checksum line that is wrong. Returns whether it has one.
bool check_line(std::string_view text, const std::filesystem::path& path) {
  if (!text.starts_with(std::string(kKey) + " = ")) return false;
  const size_t line = std::min(text.find('\n'), text.size() - 1) + 1;
  if (text.substr(0, line) == checksum_line(text.substr(line))) return true;
  throw InputError(path.string() +
                   ": damaged: the checksum in its first line is not that of the other lines");
}

}  // namespace

std::string with_checksum(std::string_view content) {
  return checksum_line(content) + std::string(content);
}

TomlTable parse_checksummed(std::string_view text, const std::filesystem::path& path) {
  const bool has_checksum = check_line(text, path);
  TomlTable table = TomlTable::parse(text, path);
  if (has_checksum) table.text(kKey);  // else an unknown field
  return table;
}

}  // namespace v3d
