#include "take/take_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <optional>
#include <set>
#include <system_error>

#include "base/core/error.h"
#include "base/core/text.h"
#include "base/io/file.h"
#include "base/io/unique_fd.h"
#include "take/take_removal.h"
#include "wire/secret_keys.h"

namespace v3d::take {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kPrefix = ".", kExtension = ".lock";
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

bool is_full(int error) { return error == ENOSPC || error == EDQUOT; }
bool is_unsupported(int error) { return error == ENOLCK || error == EOPNOTSUPP || error == ENOSYS; }

/// True if `path` still names the locked file. Its earlier holder may have removed that file.
bool is_current(int fd, const fs::path& path) {
  struct stat locked {
  }, named{};
  return fstat(fd, &locked) == 0 && lstat(path.c_str(), &named) == 0 &&
         locked.st_dev == named.st_dev && locked.st_ino == named.st_ino;
}

/// Opens the lock file, and creates it if necessary. After a crash, the file may belong to another
/// user, who can only be read.
io::UniqueFd open_lock_file(const fs::path& path) {
  const auto open_as = [&](int flags) {
    return io::uninterrupted(
        [&] { return open(path.c_str(), flags | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0644); });
  };
  const int fd = open_as(O_RDWR | O_CREAT);
  return io::UniqueFd(fd < 0 && errno == EACCES ? open_as(O_RDONLY) : fd);
}

/// The nodes that may have a process on the take: those of the lock files, and those of the studio
/// file. A studio file that cannot be parsed names none.
io::Result<std::set<std::string>> possible_recorders(const TakePaths& paths) {
  const auto entries = io::list_folder(paths.folder);
  if (!entries) return tl::make_unexpected(entries.error());
  std::set<std::string> nodes;
  for (const fs::path& entry : *entries) {
    const std::string name = entry.filename();
    if (!name.starts_with(kPrefix) || entry.extension() != kExtension) continue;
    nodes.insert(name.substr(kPrefix.size(), name.size() - kPrefix.size() - kExtension.size()));
  }
  try {
    const std::optional<Studio> studio = load_take_studio(paths);
    for (const StudioNode& node : studio ? studio->nodes : std::vector<StudioNode>()) {
      nodes.insert(node.name);
    }
  } catch (const InputError&) {  // damaged, or of another version
  }
  return nodes;
}

}  // namespace

bool is_of_full_disk(const io::IoError& error) { return is_full(error.code); }

io::Result<TakeLock> TakeLock::acquire(const TakePaths& paths, const std::string& node) {
  const fs::path path = paths.folder / (std::string(kPrefix) + node + std::string(kExtension));
  for (int attempt = 0; attempt < kMaxAttempts; ++attempt) {
    io::UniqueFd fd = open_lock_file(path);
    if (!fd) return io::io_error("lock", path);
    const bool locked = io::uninterrupted([&] { return flock(fd.get(), LOCK_EX | LOCK_NB); }) == 0;
    if (!locked && errno == EWOULDBLOCK) {
      return io::io_error("lock", path, holder_in(fd.get()) + " has locked it", EWOULDBLOCK);
    }
    if (!locked && !is_unsupported(errno)) return io::io_error("lock", path);
    errno = 0;
    if (!is_current(fd.get(), path)) {
      if (errno != 0 && errno != ENOENT) return io::io_error("lock", path);
      continue;
    }
    write_holder(fd.get());
    return TakeLock(path, std::move(fd), locked);
  }
  return io::io_error("lock", path, "other processes create and remove it repeatedly", EAGAIN);
}

// After a deletion of the take, another process may have a new take and lock file of this name.
TakeLock::~TakeLock() {
  if (fd_ && is_current(fd_.get(), path_)) remove_working_file(path_);
}

io::Result<std::string> take_lock_holder(const TakePaths& paths) {
  const auto entries = io::list_folder(paths.folder);
  if (!entries) return tl::make_unexpected(entries.error());
  for (const fs::path& entry : *entries) {
    if (!entry.filename().string().starts_with(kPrefix) || entry.extension() != kExtension)
      continue;
    const io::UniqueFd fd(io::uninterrupted(
        [&] { return open(entry.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK); }));
    if (!fd && errno == ENOENT) continue;  // its holder has just ended
    if (!fd) return io::io_error("read the lock", entry);
    if (io::uninterrupted([&] { return flock(fd.get(), LOCK_SH | LOCK_NB); }) == 0 ||
        is_unsupported(errno))
      continue;
    if (errno != EWOULDBLOCK) return io::io_error("read the lock", entry);
    return holder_in(fd.get());
  }
  return std::string();
}

io::Result<std::vector<TakeLock>> lock_whole_take(const TakePaths& paths) {
  const auto nodes = possible_recorders(paths);
  if (!nodes) return tl::make_unexpected(nodes.error());
  std::vector<TakeLock> locks;
  for (const std::string& node : *nodes) {
    auto lock = TakeLock::acquire(paths, node);
    // On a full disk, a lock file that does not exist is held by no process.
    if (!lock && is_of_full_disk(lock.error())) continue;
    if (!lock) return tl::make_unexpected(lock.error());
    locks.push_back(*std::move(lock));
  }
  return locks;
}

namespace {

int open_at(const fs::path& path, int flags) {
  return io::uninterrupted(
      [&] { return open(path.c_str(), flags | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0644); });
}

std::string text_in(int fd) {
  std::array<char, 512> text{};
  const ssize_t size = pread(fd, text.data(), text.size(), 0);
  return {text.data(), static_cast<size_t>(std::max<ssize_t>(size, 0))};
}

/// Changes with every start of the PC, and differs between PCs. Empty when it cannot be read.
std::string boot_id() {
  const io::UniqueFd fd(open_at("/proc/sys/kernel/random/boot_id", O_RDONLY));
  if (!fd) return {};
  const std::string text = text_in(fd.get());
  return text.substr(0, text.find('\n'));
}

/// What this process writes into its `.deletion` files. No other process writes the same.
std::string deletion_text() {
  static const int64_t number = wire::random_nonce();
  return this_process() + "\nboot " + boot_id() + "\nlock " + std::to_string(number) + "\n";
}

/// True when a process of this PC that has ended wrote the text of deletion_text().
bool is_of_ended_process(const std::string& text) {
  constexpr std::string_view kStart = "process ";
  const std::string boot = boot_id();
  if (!text.starts_with(kStart) || boot.empty()) return false;
  if (text.find("\nboot " + boot + "\n") == std::string::npos) return false;
  pid_t pid = 0;
  const auto parsed = std::from_chars(text.data() + kStart.size(), text.data() + text.size(), pid);
  return parsed.ec == std::errc() && pid > 0 && kill(pid, 0) != 0 && errno == ESRCH;
}

bool may_not_write(int error) { return error == EROFS || error == EACCES || error == EPERM; }
/// The error of acquire() where the disk has no room for the file.
auto no_room_error(const fs::path& path, int error) {
  return io::io_error("lock", path,
                      std::generic_category().message(error) +
                          "; remove a file that belongs to no take from this disk, and repeat the "
                          "command",
                      error);
}

/// Opens an existing `.deletion` file, for writing if possible. Fails with EEXIST or EDEADLK while
/// a process has the lock, and with ENOENT when there is no file.
io::Result<io::UniqueFd> open_left_file(const fs::path& path, const std::string& own) {
  io::UniqueFd fd(open_at(path, O_RDWR));
  if (!fd && may_not_write(errno)) fd.reset(open_at(path, O_RDONLY));
  if (!fd) return io::io_error("lock", path);
  const std::string text = text_in(fd.get());
  if (text.starts_with(own)) {
    return io::io_error("lock", path, "this process has locked it", EDEADLK);
  }
  const bool is_held = !is_of_ended_process(text) ||
                       (flock(fd.get(), LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK);
  if (!is_held) return fd;
  return io::io_error("lock", path,
                      holder_in(fd.get()) +
                          " deletes this take, or needs it as a copy; if that process has ended, "
                          "remove this file",
                      EEXIST);
}

}  // namespace

io::Result<DeletionLock> DeletionLock::acquire(const TakePaths& paths) {
  const fs::path path = paths.folder / ".deletion";
  const std::string own = deletion_text();
  const auto held = [&](io::UniqueFd fd) {
    static_cast<void>(pwrite(fd.get(), own.data(), own.size(), 0) > 0);
    return DeletionLock(path, std::move(fd));
  };
  for (int attempt = 0; attempt < kMaxAttempts; ++attempt) {
    io::UniqueFd created(open_at(path, O_RDWR | O_CREAT | O_EXCL));
    const int error = errno;
    if (created) {
      static_cast<void>(flock(created.get(), LOCK_EX | LOCK_NB));  // for open_left_file()
      return held(std::move(created));
    }
    if (error != EEXIST && !may_not_write(error) && !is_full(error)) {
      return io::io_error("lock", path);
    }
    auto left = open_left_file(path, own);
    const bool is_absent = !left && left.error().code == ENOENT;
    if (!left && !is_absent) return tl::make_unexpected(left.error());
    if (is_absent && is_full(error)) return no_room_error(path, error);
    if (is_absent && error != EEXIST) return DeletionLock({}, {});
    if (is_absent || !is_current(left->get(), path)) continue;  // its holder has just ended
    if ((fcntl(left->get(), F_GETFL) & O_ACCMODE) == O_RDONLY) return DeletionLock({}, {});
    return held(*std::move(left));
  }
  return io::io_error("lock", path, "other processes create and remove it repeatedly", EAGAIN);
}

DeletionLock::~DeletionLock() {
  if (fd_ && is_current(fd_.get(), path_)) remove_working_file(path_);
}

}  // namespace v3d::take
