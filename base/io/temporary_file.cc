#include "base/io/temporary_file.h"

#include <unistd.h>

#include <atomic>
#include <cstdio>
#include <string>
#include <string_view>

namespace v3d::io {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kTemporary = ".part-";

/// A name beside `path` that is unique in this process.
fs::path temporary_path(const fs::path& path) {
  static std::atomic<uint64_t> count = 0;
  return path.string() + std::string(kTemporary) + std::to_string(getpid()) + "-" +
         std::to_string(++count);
}

}  // namespace

Result<File> create_temporary(const fs::path& path) {
  for (;;) {
    auto file = File::open(temporary_path(path), OpenMode::kCreate);
    if (file || file.error().code != EEXIST) return file;
  }
}

Status sync_and_rename(File file, Status status, const fs::path& path) {
  if (status) status = file.sync();
  if (status && ::rename(file.path().c_str(), path.c_str()) != 0) {
    status = io_error("replace", path);
  }
  if (!status) ::unlink(file.path().c_str());
  return status;
}

bool is_temporary(const fs::path& path) {
  const std::string name = path.filename();
  const size_t at = name.rfind(kTemporary);
  return at != std::string::npos &&
         name.find_first_not_of("0123456789-", at + kTemporary.size()) == std::string::npos;
}

}  // namespace v3d::io
