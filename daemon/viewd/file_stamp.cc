#include "daemon/viewd/file_stamp.h"

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

std::string tag_of(const FileStamp& stamp) {
  return "\"" + std::to_string(stamp.size) + "-" + std::to_string(stamp.changed_ns) + "\"";
}

}  // namespace v3d
