#include "daemon/viewd/file_stamp.h"

#include <algorithm>

#include "take/logs/log_segments.h"

namespace v3d {

FileStamp stamp_of(const struct stat& state) {
  return {.inode = state.st_ino,
          .size = state.st_size,
          .changed_ns = state.st_mtim.tv_sec * 1'000'000'000LL + state.st_mtim.tv_nsec};
}

std::optional<FileStamp> stamp_of(const std::filesystem::path& path) {
  struct stat state {};
  if (lstat(path.c_str(), &state) != 0 || !S_ISREG(state.st_mode)) return {};
  return stamp_of(state);
}

std::optional<FileStamp> stamp_of_log(const std::filesystem::path& log) {
  std::optional<FileStamp> sum;
  const auto segments = existing_segments(log);
  if (!segments) return {};
  for (const std::filesystem::path& path : *segments) {
    const auto segment = stamp_of(path);
    if (!segment) return {};
    if (!sum) {
      sum = segment;
      continue;
    }
    sum->size += segment->size;
    sum->changed_ns = std::max(sum->changed_ns, segment->changed_ns);
  }
  return sum;
}

std::string tag_of(const FileStamp& stamp) {
  return "\"" + std::to_string(stamp.size) + "-" + std::to_string(stamp.changed_ns) + "\"";
}

}  // namespace v3d
