// Trace file of the fault injector: the changes that programs made in a folder, in order.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace v3d::test {

/// Kinds of changes, with the fields that each one uses.
enum class Change : uint32_t {
  kCreate,    ///< path, file: a new empty file
  kMakeDir,   ///< path, file: a new folder
  kWrite,     ///< file, offset, bytes
  kTruncate,  ///< file, offset: its new length; also for fallocate()
  kSync,      ///< file: fsync() or fdatasync() of a file or folder
  kSyncAll,   ///< syncfs()
  kRename,    ///< path, other
  kLink,      ///< path, other: a second name
  kUnlink,    ///< path; also rmdir()
  kMark,      ///< bytes: a line that the program reported to the test
};

/// Header of every record; path, other and bytes follow it.
struct ChangeHead {
  Change change;
  uint32_t path_size, other_size;
  uint64_t file;  ///< inode number
  uint64_t offset;
  uint64_t bytes_size;
};

/// One record of the trace.
struct TracedChange {
  Change change;
  uint64_t file = 0;
  uint64_t offset = 0;
  std::string path, other;  ///< absolute
  std::string bytes;
};

/// Reads the trace up to its end or to the first incomplete record.
std::vector<TracedChange> read_trace(const std::filesystem::path& file);

}  // namespace v3d::test
