// Identity of the content of a file, for caches and ETags.
#pragma once

#include <sys/stat.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace v3d {

struct FileStamp {
  uint64_t inode = 0;
  int64_t size = 0;        ///< bytes
  int64_t changed_ns = 0;  ///< modification time, by the file system's clock
  friend bool operator==(const FileStamp&, const FileStamp&) = default;
};

FileStamp stamp_of(const struct stat& state);
/// The stamp of a regular file; empty for anything else, links included.
std::optional<FileStamp> stamp_of(const std::filesystem::path& path);
/// The stamp of all segments of an event log: inode of the first, total size, latest modification.
/// Empty if there is none, or if one is not a regular file.
std::optional<FileStamp> stamp_of_log(const std::filesystem::path& log);

/// The ETag of HTTP, with quotation marks.
std::string tag_of(const FileStamp& stamp);

}  // namespace v3d
