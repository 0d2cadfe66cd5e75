// The trace of what a program changed in a folder, in order, as the fault injector records it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace v3d::test {

enum class Change : uint32_t {
  kCreate,    ///< path, file: a new empty file
  kMakeDir,   ///< path, file: a new folder
  kWrite,     ///< file, offset, bytes
  kTruncate,  ///< file, offset: its new length; allocation makes a file longer in the same way
  kSync,      ///< file: fsync() or fdatasync() of a file or folder
  kSyncAll,   ///< syncfs()
  kRename,    ///< path, other
  kLink,      ///< path, other: a second name
  kUnlink,    ///< path; also rmdir()
  kMark,      ///< bytes: what the program reported to the test
};

/// In front of every record; path, other and bytes follow.
struct ChangeHead {
  Change change;
  uint32_t path_size, other_size;
  uint64_t file;  ///< inode number
  uint64_t offset;
  uint64_t bytes_size;
};

struct TracedChange {
  Change change;
  uint64_t file = 0;
  uint64_t offset = 0;
  std::string path, other;  ///< absolute
  std::string bytes;
};

/// A record that is not whole ends the trace.
std::vector<TracedChange> read_trace(const std::filesystem::path& file);

}  // namespace v3d::test
