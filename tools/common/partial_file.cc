#include "common/partial_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <system_error>

#include "base/core/error.h"
#include "base/io/file.h"
#include "base/io/recorded_file.h"

namespace v3d {
namespace {

namespace fs = std::filesystem;

void require_replaceable(const fs::path& file) {
  if (io::value_or_throw(io::type_of(file)) == fs::file_type::directory) {
    throw InputError(file.string() + ": is a folder; expected the name of a file");
  }
  require_unrecorded(file);
}

io::Status sync_file(const fs::path& path) {
  const auto file = io::File::open(path, io::OpenMode::kRead);
  return file ? file->sync() : tl::make_unexpected(file.error());
}

}  // namespace

PartialFile::PartialFile(const fs::path& file) : file_(fs::absolute(file)) {
  require_replaceable(file_);
  path_ = file_.parent_path() / ("." + file_.stem().string() + "." + std::to_string(getpid()) +
                                 file_.extension().string());
}

PartialFile::~PartialFile() {
  if (finished_) return;
  std::error_code ignored;
  fs::remove(path_, ignored);
}

void PartialFile::finish() {
  io::throw_if_failed(sync_file(path_));
  if (::rename(path_.c_str(), file_.c_str()) != 0) {
    io::throw_if_failed(io::io_error("replace", file_));
  }
  finished_ = true;
  io::throw_if_failed(io::sync_folder(file_.parent_path()));
}

namespace {

namespace fs = std::filesystem;

bool holds_files(const fs::path& folder) {
  return !io::value_or_throw(io::list_folder(folder)).empty();
}

void require_free_name(const fs::path& folder, PartialFolder::Existing existing) {
  const auto type = io::value_or_throw(io::entry_type_of(folder));
  if (type == fs::file_type::not_found) return;
  if (type != fs::file_type::directory) {
    throw InputError(folder.string() + ": is a file; expected the name of a new folder");
  }
  if (existing == PartialFolder::Existing::kReject && holds_files(folder)) {
    throw InputError(folder.string() + ": is not empty; expected a new or an empty folder");
  }
}

fs::path make_beside(const fs::path& folder) {
  std::string pattern = folder.string() + ".partial-XXXXXX";
  if (mkdtemp(pattern.data()) == nullptr) {
    io::throw_input_error(io::io_error("make folder", pattern).value());
  }
  fs::permissions(pattern, fs::perms(0755));
  return pattern;
}

/// Gives two folders each other's name by a third one; `b` is absent for a moment. After a failure
/// both have their names.
int exchange_by_third_name(const fs::path& a, const fs::path& b) {
  const fs::path third = a.string() + ".earlier";
  if (::rename(b.c_str(), third.c_str()) != 0) return -1;
  if (::rename(a.c_str(), b.c_str()) == 0) return ::rename(third.c_str(), a.c_str());
  const int error = errno;
  ::rename(third.c_str(), b.c_str());
  errno = error;
  return -1;
}

/// Exchanges the names of two folders. File systems such as NFS have no RENAME_EXCHANGE.
void exchange(const fs::path& a, const fs::path& b) {
  int result = renameat2(AT_FDCWD, a.c_str(), AT_FDCWD, b.c_str(), RENAME_EXCHANGE);
  if (result != 0 && (errno == EINVAL || errno == ENOSYS)) result = exchange_by_third_name(a, b);
  if (result != 0) io::throw_if_failed(io::io_error("replace", b));
}

}  // namespace

fs::path normal_folder(const fs::path& folder) {
  const fs::path path = fs::absolute(folder).lexically_normal();
  return path.has_filename() ? path : path.parent_path();
}

PartialFolder::PartialFolder(const fs::path& folder, Existing existing)
    : folder_(normal_folder(folder)), existing_(existing) {
  require_free_name(folder_, existing_);
  path_ = make_beside(folder_);
}

PartialFolder::~PartialFolder() {
  if (finished_) return;
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

void PartialFolder::finish() {
  ::rmdir(folder_.c_str());  // fails unless it is an empty folder
  if (existing_ == Existing::kReplace && fs::is_directory(folder_)) {
    exchange(path_, folder_);  // the destructor removes the earlier folder
    io::throw_if_failed(io::sync_folder(folder_.parent_path()));
    return;
  }
  io::throw_if_failed(io::rename_new(path_, folder_));
  finished_ = true;
}

}  // namespace v3d
