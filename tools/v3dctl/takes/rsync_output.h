// The output of rsync.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace v3d::ctl {

/// A line of rsync --list-only: "drwxr-xr-x  4,096 2026/11/21 10:02:03 kendo-07/take.toml". rsync
/// writes the bytes of a name that are no text as "\#012".
struct ListedEntry {
  char type = ' ';  ///< 'd': folder, 'l': link to no folder, as of --copy-dirlinks
  std::filesystem::path path;
};

/// Empty for a line that is no entry.
std::optional<ListedEntry> parse_entry(const std::string& line);

/// The files of a take that only the receiver has, by the output of rsync --dry-run --delete
/// --itemize-changes: "*deleting   cam01.0001.lcmlog". Without folders, and without temporary
/// files, which vanish on a node.
std::vector<std::string> absent_files(const std::string& itemized);

/// The size of all files of the sender in the output of rsync --stats: "Total file size: 1,234
/// bytes"; 0 without this line.
int64_t total_bytes(const std::string& output);

}  // namespace v3d::ctl
