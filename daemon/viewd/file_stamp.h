// What tells that a file is still what it was.
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
  int64_t changed_ns = 0;  ///< its last change, by the file system's clock
  friend bool operator==(const FileStamp&, const FileStamp&) = default;
};

FileStamp stamp_of(const struct stat& state);
/// Of a regular file; empty for anything else, links included.
std::optional<FileStamp> stamp_of(const std::filesystem::path& path);
/// Of all segments of an event log: inode of the first, bytes of all, the last change of any. Empty
/// when there is none or one is no regular file.
std::optional<FileStamp> stamp_of_log(const std::filesystem::path& log);

/// For HTTP, with its quotation marks: another content has another tag.
std::string tag_of(const FileStamp& stamp);

}  // namespace v3d
