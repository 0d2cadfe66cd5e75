#include "take/take_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>

#include "base/core/printable.h"
#include "base/io/file.h"
#include "base/io/uninterrupted.h"
#include "take/take_removal.h"

namespace v3d {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kExtension = ".lock";
constexpr int kMaxAttempts = 100;

std::string this_process() {
  std::array<char, 256> host{};
  gethostname(host.data(), host.size() - 1);
  return "process " + std::to_string(getpid()) + " on " + host.data();
}

std::string holder_in(int fd) {
  std::array<char, 320> text{};
  const ssize_t size = pread(fd, text.data(), text.size(), 0);
  if (size <= 0) return "another process";
  const std::string_view written(text.data(), static_cast<size_t>(size));
  return printable(written.substr(0, written.find('\n')));
}

/// Writes this process into the lock file, for messages of other processes only. Write errors, for
/// example of a full disk, are ignored. Text of an earlier holder may remain after the first line.
void write_holder(int fd) {
  const std::string text = this_process() + "\n";
  static_cast<void>(pwrite(fd, text.data(), text.size(), 0) > 0);
}

bool is_unsupported(int error) { return error == ENOLCK || error == EOPNOTSUPP || error == ENOSYS; }

/// True if `path` still names the locked file. Its earlier holder may have removed that file.
bool is_current(int fd, const fs::path& path) {
  struct stat locked {
  }, named{};
  return fstat(fd, &locked) == 0 && lstat(path.c_str(), &named) == 0 &&
         locked.st_dev == named.st_dev && locked.st_ino == named.st_ino;
}

}  // namespace

io::Result<TakeLock> TakeLock::acquire(const TakePaths& paths, const std::string& node) {
  const fs::path path = paths.folder / ("." + node + std::string(kExtension));
  for (int attempt = 0; attempt < kMaxAttempts; ++attempt) {
    io::UniqueFd fd(io::uninterrupted(
        [&] { return open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0644); }));
    if (!fd) return io::io_error("lock", path);
    const bool locked =
        io::uninterrupted([&] { return flock(fd.get(), LOCK_EX | LOCK_NB); }) == 0;
    if (!locked && errno == EWOULDBLOCK) {
      return io::io_error("lock", path, holder_in(fd.get()) + " records into it", EWOULDBLOCK);
    }
    if (!locked && !is_unsupported(errno)) return io::io_error("lock", path);
    if (!is_current(fd.get(), path)) continue;
    write_holder(fd.get());
    return TakeLock(path, std::move(fd), locked);
  }
  return io::io_error("lock", path, "other processes create and remove it repeatedly", EAGAIN);
}

TakeLock::~TakeLock() {
  if (fd_) remove_working_file(path_);
}

std::string take_lock_holder(const TakePaths& paths) {
  const auto entries = io::list_folder(paths.folder);
  for (const fs::path& entry : entries.value_or(std::vector<fs::path>())) {
    if (!entry.filename().string().starts_with(".") || entry.extension() != kExtension) continue;
    const io::UniqueFd fd(open(entry.c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW));
    if (fd && flock(fd.get(), LOCK_SH | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
      return holder_in(fd.get());
    }
  }
  return {};
}

}  // namespace v3d
