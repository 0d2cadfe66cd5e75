#include "base/io/file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <sys/uio.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <string>
#include <vector>

#include "base/core/error.h"
#include "base/io/recorded_file.h"
#include "base/io/temporary_file.h"
#include "base/io/unique_fd.h"

namespace v3d::io {
namespace {

namespace fs = std::filesystem;

fs::path folder_of(const fs::path& path) {
  return path.has_parent_path() ? path.parent_path() : fs::path(".");
}

int flags_of(OpenMode mode) {
  // A FIFO would block without O_NONBLOCK; regular files ignore it.
  constexpr int kCommonFlags = O_CLOEXEC | O_NONBLOCK | O_NOCTTY;
  switch (mode) {
    case OpenMode::kRead:
      return O_RDONLY | kCommonFlags;
    case OpenMode::kReadWithinFolder:
      return O_RDONLY | O_NOFOLLOW | kCommonFlags;
    case OpenMode::kCreate:
    case OpenMode::kCreatePrivate:
      return O_RDWR | O_CREAT | O_EXCL | kCommonFlags;
    case OpenMode::kWriteExisting:
      return O_RDWR | O_NOFOLLOW | kCommonFlags;
  }
  return O_RDONLY | kCommonFlags;
}

std::string_view action_of(OpenMode mode) {
  switch (mode) {
    case OpenMode::kRead:
    case OpenMode::kReadWithinFolder:
      return "read";
    case OpenMode::kCreate:
    case OpenMode::kCreatePrivate:
      return "create";
    case OpenMode::kWriteExisting:
      return "write";
  }
  return "open";
}

std::span<const uint8_t> bytes_of(std::string_view text) {
  return {reinterpret_cast<const uint8_t*>(text.data()), text.size()};
}

/// Gives a file a second name, which fails with EEXIST when the name is taken, and removes the
/// first. After a crash between the two calls the file has both names.
int move_file(const fs::path& from, const fs::path& to) {
  return ::link(from.c_str(), to.c_str()) == 0 ? ::unlink(from.c_str()) : -1;
}

/// Reserves the name with an empty folder, which fails with EEXIST when the name is taken, and
/// renames onto it, which fails when the folder is no longer empty.
int move_folder(const fs::path& from, const fs::path& to) {
  if (::mkdir(to.c_str(), 0777) != 0) return -1;
  if (::rename(from.c_str(), to.c_str()) == 0) return 0;
  const int error = errno;
  ::rmdir(to.c_str());  // fails, as intended, when the folder is not empty
  errno = error;
  return -1;
}

/// renameat2(RENAME_NOREPLACE); on file systems without the flag (NFS) two calls, neither of which
/// replaces anything.
int rename_to_new_name(const fs::path& from, const fs::path& to) {
  if (renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0) return 0;
  struct stat status {};
  if ((errno != EINVAL && errno != ENOSYS) || lstat(from.c_str(), &status) != 0) return -1;
  return S_ISDIR(status.st_mode) ? move_folder(from, to) : move_file(from, to);
}

/// `result`: of stat() or lstat(), with its errno.
Result<fs::file_type> type_from(int result, const struct stat& status, const fs::path& path) {
  if (result != 0 && (errno == ENOENT || errno == ENOTDIR)) return fs::file_type::not_found;
  if (result != 0) return io_error("read", path);
  if (S_ISREG(status.st_mode)) return fs::file_type::regular;
  if (S_ISDIR(status.st_mode)) return fs::file_type::directory;
  return S_ISLNK(status.st_mode) ? fs::file_type::symlink : fs::file_type::unknown;
}

Status copy_bytes(const File& from, File& to) {
  std::vector<uint8_t> chunk(1 << 20);
  for (uint64_t offset = 0;;) {
    const auto got = from.read(offset, chunk);
    if (!got) return tl::make_unexpected(got.error());
    if (*got == 0) return {};
    if (Status status = to.write(offset, {std::span(chunk).first(*got)}); !status) return status;
    offset += *got;
  }
}

}  // namespace

Result<File> File::open(fs::path path, OpenMode mode) {
  const mode_t rights = mode == OpenMode::kCreatePrivate ? 0600 : 0644;
  UniqueFd fd(uninterrupted([&] { return ::open(path.c_str(), flags_of(mode), rights); }));
  if (!fd && errno == ELOOP && (flags_of(mode) & O_NOFOLLOW) != 0) {
    return io_error(action_of(mode), path,
                    "it is a symbolic link, or its path has too many of them", ELOOP);
  }
  if (!fd) return io_error(action_of(mode), path);
  if ((flags_of(mode) & O_EXCL) == 0) {  // a file that was just made is a regular one
    struct stat status {};
    if (fstat(fd.get(), &status) != 0) return io_error(action_of(mode), path);
    if (!S_ISREG(status.st_mode)) {
      return io_error(action_of(mode), path, "it is not a regular file");
    }
  }
  return File(std::move(path), std::move(fd));
}

Result<uint64_t> File::size() const {
  struct stat status {};
  if (fstat(fd_.get(), &status) != 0) return io_error("read", path_);
  return static_cast<uint64_t>(status.st_size);
}

Result<size_t> File::read(uint64_t offset, std::span<uint8_t> bytes) const {
  size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t n = uninterrupted([&] {
      return pread(fd_.get(), bytes.data() + done, bytes.size() - done,
                   static_cast<off_t>(offset + done));
    });
    if (n < 0) return io_error("read", path_);
    if (n == 0) break;
    done += static_cast<size_t>(n);
  }
  return done;
}

Status File::read_whole(uint64_t offset, std::span<uint8_t> bytes) const {
  const auto got = read(offset, bytes);
  if (!got) return tl::make_unexpected(got.error());
  if (*got < bytes.size())
    return io_error("read", path_, "the file became shorter while it was read", EIO);
  return {};
}

Status File::write(uint64_t offset, std::initializer_list<std::span<const uint8_t>> parts) {
  constexpr size_t kMaxParts = 4;
  std::array<iovec, kMaxParts> vectors{};
  V3D_CHECK(parts.size() <= kMaxParts);
  size_t count = 0;
  for (const auto part : parts) {  // pwritev() only reads
    if (!part.empty()) vectors[count++] = {const_cast<uint8_t*>(part.data()), part.size()};
  }
  std::span<iovec> remaining(vectors.data(), count);
  while (!remaining.empty()) {
    const ssize_t n = uninterrupted([&] {
      return pwritev(fd_.get(), remaining.data(), static_cast<int>(remaining.size()),
                     static_cast<off_t>(offset));
    });
    if (n < 0) return io_error("write", path_);
    if (n == 0) return io_error("write", path_, "the file system accepts no bytes", EIO);
    offset += static_cast<uint64_t>(n);
    auto written = static_cast<size_t>(n);
    while (!remaining.empty() && written >= remaining.front().iov_len) {
      written -= remaining.front().iov_len;
      remaining = remaining.subspan(1);
    }
    if (written > 0) {
      remaining.front().iov_base = static_cast<uint8_t*>(remaining.front().iov_base) + written;
      remaining.front().iov_len -= written;
    }
  }
  return {};
}

Status File::sync() const {
  if (uninterrupted([&] { return fsync(fd_.get()); }) != 0) return io_error("sync", path_);
  return {};
}

Status sync_folder(const fs::path& folder) {
  const UniqueFd fd(
      uninterrupted([&] { return ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC); }));
  if (!fd) return io_error("sync folder", folder);
  // File systems without fsync of folders (some FUSE mounts) return EINVAL; nothing to wait for.
  if (uninterrupted([&] { return fsync(fd.get()); }) != 0 && errno != EINVAL) {
    return io_error("sync folder", folder);
  }
  return {};
}

Result<std::string> read_file(const fs::path& path, uint64_t max_bytes, OpenMode mode) {
  const auto file = File::open(path, mode);
  if (!file) return tl::make_unexpected(file.error());
  const auto size = file->size();
  if (!size) return tl::make_unexpected(size.error());
  const auto too_long = [&] {
    return io_error("read", path, "it is longer than " + std::to_string(max_bytes) + " bytes",
                    EFBIG);
  };
  if (*size > max_bytes) return too_long();
  std::string content;
  content.reserve(*size);
  std::array<uint8_t, 1 << 16> chunk{};
  for (;;) {  // the size of files in /proc is 0
    const auto got = file->read(content.size(), chunk);
    if (!got) return tl::make_unexpected(got.error());
    if (*got == 0) return content;
    content.append(reinterpret_cast<const char*>(chunk.data()), *got);
    if (content.size() > max_bytes) return too_long();
  }
}

Status replace_file(const fs::path& path, std::string_view content) {
  auto file = create_temporary(path);
  if (!file) return tl::make_unexpected(file.error());
  Status status = file->write(0, {bytes_of(content)});
  status = sync_and_rename(*std::move(file), std::move(status), path);
  return status ? sync_folder(folder_of(path)) : status;
}

Status copy_file(const fs::path& from, const fs::path& to) {
  const auto source = File::open(from, OpenMode::kRead);
  if (!source) return tl::make_unexpected(source.error());
  auto file = create_temporary(to);
  if (!file) return tl::make_unexpected(file.error());
  Status status = copy_bytes(*source, *file);
  return sync_and_rename(*std::move(file), std::move(status), to);
}

Result<std::vector<fs::path>> list_folder(const fs::path& folder) {
  std::vector<fs::path> entries;
  const std::error_code error = uninterrupted_code([&](std::error_code& code) {
    entries.clear();
    for (fs::directory_iterator entry(folder, code), end; !code && entry != end;
         entry.increment(code)) {
      entries.push_back(entry->path());
    }
  });
  if (error) return io_error("list folder", folder, error.message(), error.value());
  std::sort(entries.begin(), entries.end());
  return entries;
}

Result<fs::file_type> type_of(const fs::path& path) {
  struct stat status {};
  return type_from(::stat(path.c_str(), &status), status, path);
}

Result<fs::file_type> entry_type_of(const fs::path& path) {
  struct stat status {};
  return type_from(::lstat(path.c_str(), &status), status, path);
}

Result<uint64_t> free_bytes(const fs::path& folder) {
  struct statvfs status {};
  if (uninterrupted([&] { return ::statvfs(folder.c_str(), &status); }) != 0) {
    return io_error("read the free space of", folder);
  }
  return uint64_t{status.f_bavail} * status.f_frsize;
}

Status create_folders(const fs::path& folder) {
  std::error_code error;
  if (fs::is_directory(folder, error)) return {};
  const fs::path parent = folder_of(folder);
  if (parent != folder) {
    if (Status status = create_folders(parent); !status) return status;
  }
  if (::mkdir(folder.c_str(), 0777) != 0 && errno != EEXIST) return io_error("make folder", folder);
  const bool is_folder = fs::is_directory(folder, error);
  if (error) return io_error("make folder", folder, error.message(), error.value());
  if (!is_folder) return io_error("make folder", folder, "a file has this name", EEXIST);
  return sync_folder(parent);
}

Status sync_file_system(const std::filesystem::path& folder) {
  const UniqueFd fd(
      uninterrupted([&] { return ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC); }));
  if (!fd || uninterrupted([&] { return syncfs(fd.get()); }) != 0)
    return io_error("sync the file system of", folder);
  return {};
}

Status rename_new(const fs::path& from, const fs::path& to) {
  if (rename_to_new_name(from, to) != 0) return io_error("rename " + from.string() + " to", to);
  if (Status status = sync_folder(folder_of(to)); !status) return status;
  return folder_of(from) == folder_of(to) ? Status() : sync_folder(folder_of(from));
}

}  // namespace v3d::io

namespace v3d {

bool file_exists(const std::filesystem::path& path) {
  return io::value_or_throw(io::type_of(path)) != std::filesystem::file_type::not_found;
}

std::string read_file(const std::filesystem::path& path) {
  return io::value_or_throw(io::read_file(path));
}

std::string read_take_text(const std::filesystem::path& path) {
  return io::value_or_throw(
      io::read_file(path, kMaxTakeTextBytes, io::OpenMode::kReadWithinFolder));
}

void replace_file(const std::filesystem::path& path, std::string_view text) {
  require_unrecorded(path);
  io::throw_if_failed(io::replace_file(path, text));
}

}  // namespace v3d

namespace v3d::io {

tl::unexpected<IoError> io_error(std::string_view action, const std::filesystem::path& path) {
  const int code = errno;
  return io_error(action, path, strerrordesc_np(code) ? strerrordesc_np(code) : "unknown error",
                  code);
}

tl::unexpected<IoError> io_error(std::string_view action, const std::filesystem::path& path,
                                 std::string_view cause, int code) {
  return tl::make_unexpected(IoError{
      code, "cannot " + std::string(action) + " " + path.string() + ": " + std::string(cause)});
}

void throw_input_error(const IoError& error) { throw InputError(error.message); }

void throw_if_failed(const Status& status) {
  if (!status) throw std::runtime_error(status.error().message);
}

}  // namespace v3d::io
