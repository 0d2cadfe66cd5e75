// Library to preload into a program (LD_PRELOAD). It makes system calls on the program's files
// fail, or records the program's changes to a folder. fault_plan.h lists the environment variables.
//
// It intercepts calls through the dynamic linker only, not calls inside the C library (fread,
// fwrite). It replaces mkstemp and remove, so that their system calls are intercepted too.
#include <dirent.h>
#include <dlfcn.h>
#include <fcntl.h>
#include <sched.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/sendfile.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

#include <cerrno>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>

#include "fault_plan.h"
#include "trace_writer.h"

namespace v3d::test {
namespace {

FaultPlan& plan() { return FaultPlan::of_process(); }

template <class Function>
Function* real(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

/// Returns -1 and sets errno as planned, or returns the result of `call`. For calls that transfer
/// no bytes.
template <class Call>
auto unless_faulty(FaultKind kind, Call call) -> decltype(call()) {
  if (kind == FaultKind::kNone) return call();
  errno = plan().error();
  return decltype(call())(-1);
}

/// The same for calls that transfer up to `size` bytes. `call` gets the number of bytes to
/// transfer.
template <class Call>
ssize_t transfer(FaultKind kind, size_t size, Call call) {
  if (kind == FaultKind::kError) {
    errno = plan().error();
    return -1;
  }
  const bool is_short = kind == FaultKind::kShort && size > 1;
  return call(is_short ? size / 2 : size);
}

std::string bytes_of(const iovec* parts, int count, size_t size) {
  std::string bytes;
  for (int i = 0; i < count && bytes.size() < size; ++i) {
    bytes.append(static_cast<const char*>(parts[i].iov_base),
                 std::min(parts[i].iov_len, size - bytes.size()));
  }
  return bytes;
}

// --- open ---------------------------------------------------------------------------------------

template <class Call>
int open_file(const std::string& path, int flags, Call call) {
  const FaultKind kind = plan().next("open", path);
  if (kind != FaultKind::kNone) return unless_faulty(kind, [] { return -1; });
  if (!plan().traces() || !plan().is_below(path)) return call();
  const TraceLock lock;
  const bool was_there = exists(path);
  const int fd = call();
  if (fd < 0) return fd;
  if ((flags & O_CREAT) != 0 && !was_there) record_names(Change::kCreate, path);
  if ((flags & O_TRUNC) != 0 && was_there) record_length(fd, 0);
  return fd;
}

int flags_of(const char* mode) {
  const std::string_view text(mode);
  const bool updates = text.find('+') != std::string_view::npos;
  if (text.starts_with("r")) return updates ? O_RDWR : O_RDONLY;
  return (updates ? O_RDWR : O_WRONLY) | O_CREAT | (text.starts_with("w") ? O_TRUNC : O_APPEND);
}

/// True when the variable arguments of open() hold a mode.
bool has_mode(int flags) { return (flags & (O_CREAT | O_TMPFILE)) != 0; }

}  // namespace
}  // namespace v3d::test

using namespace v3d::test;

#define MODE_AFTER(flags)             \
  mode_t mode = 0;                    \
  if (has_mode(flags)) {              \
    va_list arguments;                \
    va_start(arguments, flags);       \
    mode = va_arg(arguments, mode_t); \
    va_end(arguments);                \
  }

extern "C" {

int open(const char* path, int flags, ...) {
  static auto* const next = real<int(const char*, int, mode_t)>("open");
  MODE_AFTER(flags)
  return open_file(absolute_path(AT_FDCWD, path), flags, [&] { return next(path, flags, mode); });
}
int open64(const char* path, int flags, ...) __attribute__((alias("open")));

int __open_2(const char* path, int flags) {
  return open_file(absolute_path(AT_FDCWD, path), flags,
                   [&] { return static_cast<int>(syscall(SYS_openat, AT_FDCWD, path, flags, 0)); });
}
int __open64_2(const char* path, int flags) __attribute__((alias("__open_2")));

int openat(int at, const char* path, int flags, ...) {
  static auto* const next = real<int(int, const char*, int, mode_t)>("openat");
  MODE_AFTER(flags)
  return open_file(absolute_path(at, path), flags, [&] { return next(at, path, flags, mode); });
}
int openat64(int at, const char* path, int flags, ...) __attribute__((alias("openat")));

int __openat_2(int at, const char* path, int flags) {
  return open_file(absolute_path(at, path), flags,
                   [&] { return static_cast<int>(syscall(SYS_openat, at, path, flags, 0)); });
}

int mkstemp(char* pattern) {
  // As documented for mkstemp(), through the open() above.
  const size_t length = std::string_view(pattern).size();
  for (unsigned number = static_cast<unsigned>(getpid()) * 64; length >= 6; ++number) {
    std::snprintf(pattern + length - 6, 7, "%06x", number & 0xFFFFFFU);
    const int fd = open(pattern, O_RDWR | O_CREAT | O_EXCL, 0600);
    if (fd >= 0 || errno != EEXIST) return fd;
  }
  errno = EINVAL;
  return -1;
}
int mkstemp64(char* pattern) __attribute__((alias("mkstemp")));

FILE* fopen(const char* path, const char* mode) {
  static auto* const next = real<FILE*(const char*, const char*)>("fopen");
  FILE* file = nullptr;
  open_file(absolute_path(AT_FDCWD, path), flags_of(mode), [&] {
    file = next(path, mode);
    return file == nullptr ? -1 : fileno(file);
  });
  return file;
}
FILE* fopen64(const char* path, const char* mode) __attribute__((alias("fopen")));

// --- folders and metadata -----------------------------------------------------------------------

DIR* opendir(const char* path) {
  static auto* const next = real<DIR*(const char*)>("opendir");
  const FaultKind kind = plan().next("opendir", absolute_path(AT_FDCWD, path));
  if (kind == FaultKind::kNone) return next(path);
  errno = plan().error();
  return nullptr;
}

DIR* fdopendir(int fd) {
  static auto* const next = real<DIR*(int)>("fdopendir");
  const FaultKind kind = plan().next("opendir", path_of(fd));
  if (kind == FaultKind::kNone) return next(fd);
  errno = plan().error();
  return nullptr;
}

dirent* readdir(DIR* folder) {
  static auto* const next = real<dirent*(DIR*)>("readdir");
  const FaultKind kind = plan().next("readdir", path_of(dirfd(folder)));
  if (kind == FaultKind::kNone) return next(folder);
  errno = plan().error();
  return nullptr;
}
dirent64* readdir64(DIR* folder) __attribute__((alias("readdir")));

int stat(const char* path, struct stat* status) {
  static auto* const next = real<int(const char*, struct stat*)>("stat");
  return unless_faulty(plan().next("stat", absolute_path(AT_FDCWD, path)),
                       [&] { return next(path, status); });
}
int stat64(const char* path, struct stat64* status) __attribute__((alias("stat")));

int lstat(const char* path, struct stat* status) {
  static auto* const next = real<int(const char*, struct stat*)>("lstat");
  return unless_faulty(plan().next("stat", absolute_path(AT_FDCWD, path)),
                       [&] { return next(path, status); });
}
int lstat64(const char* path, struct stat64* status) __attribute__((alias("lstat")));

int fstat(int fd, struct stat* status) {
  static auto* const next = real<int(int, struct stat*)>("fstat");
  return unless_faulty(plan().next("stat", path_of(fd)), [&] { return next(fd, status); });
}
int fstat64(int fd, struct stat64* status) __attribute__((alias("fstat")));

int statvfs(const char* path, struct statvfs* status) {
  static auto* const next = real<int(const char*, struct statvfs*)>("statvfs");
  return unless_faulty(plan().next("statvfs", absolute_path(AT_FDCWD, path)),
                       [&] { return next(path, status); });
}
int statvfs64(const char* path, struct statvfs64* status) __attribute__((alias("statvfs")));

int fstatvfs(int fd, struct statvfs* status) {
  static auto* const next = real<int(int, struct statvfs*)>("fstatvfs");
  return unless_faulty(plan().next("statvfs", path_of(fd)), [&] { return next(fd, status); });
}
int fstatvfs64(int fd, struct statvfs64* status) __attribute__((alias("fstatvfs")));

// --- reading and writing ------------------------------------------------------------------------

ssize_t read(int fd, void* bytes, size_t size) {
  static auto* const next = real<ssize_t(int, void*, size_t)>("read");
  return transfer(plan().next("read", path_of(fd)), size,
                  [&](size_t n) { return next(fd, bytes, n); });
}

ssize_t pread(int fd, void* bytes, size_t size, off_t offset) {
  static auto* const next = real<ssize_t(int, void*, size_t, off_t)>("pread");
  return transfer(plan().next("pread", path_of(fd)), size,
                  [&](size_t n) { return next(fd, bytes, n, offset); });
}
ssize_t pread64(int fd, void* bytes, size_t size, off_t offset) __attribute__((alias("pread")));

ssize_t write(int fd, const void* bytes, size_t size) {
  static auto* const next = real<ssize_t(int, const void*, size_t)>("write");
  const std::string path = path_of(fd);
  if (!plan().is_below(path)) return next(fd, bytes, size);  // perhaps of a signal handler
  const TraceLock lock;
  const ssize_t n = transfer(plan().next("write", path), size,
                             [&](size_t max_size) { return next(fd, bytes, max_size); });
  if (n > 0) record_write(fd, path, {static_cast<const char*>(bytes), static_cast<size_t>(n)}, -1);
  return n;
}

/// Looks up the function and makes the plan when the library is loaded: the first call may be of a
/// signal handler.
__attribute__((constructor)) void prepare_write() { write(-1, nullptr, 0); }

ssize_t pwrite(int fd, const void* bytes, size_t size, off_t offset) {
  static auto* const next = real<ssize_t(int, const void*, size_t, off_t)>("pwrite");
  const std::string path = path_of(fd);
  const TraceLock lock;
  const ssize_t n = transfer(plan().next("pwrite", path), size,
                             [&](size_t max_size) { return next(fd, bytes, max_size, offset); });
  if (n > 0) {
    record_write(fd, path, {static_cast<const char*>(bytes), static_cast<size_t>(n)}, offset);
  }
  return n;
}
ssize_t pwrite64(int fd, const void* bytes, size_t size, off_t offset)
    __attribute__((alias("pwrite")));

ssize_t writev(int fd, const iovec* parts, int count) {
  static auto* const next = real<ssize_t(int, const iovec*, int)>("writev");
  static auto* const write_some = real<ssize_t(int, const void*, size_t)>("write");
  const std::string path = path_of(fd);
  const std::string bytes = bytes_of(parts, count, SIZE_MAX);
  const TraceLock lock;
  const ssize_t n = transfer(plan().next("writev", path), bytes.size(), [&](size_t max_size) {
    return max_size < bytes.size() ? write_some(fd, bytes.data(), max_size)
                                   : next(fd, parts, count);
  });
  if (n > 0) record_write(fd, path, bytes.substr(0, static_cast<size_t>(n)), -1);
  return n;
}

ssize_t pwritev(int fd, const iovec* parts, int count, off_t offset) {
  static auto* const next = real<ssize_t(int, const iovec*, int, off_t)>("pwritev");
  static auto* const write_some = real<ssize_t(int, const void*, size_t, off_t)>("pwrite");
  const std::string path = path_of(fd);
  const std::string bytes = bytes_of(parts, count, SIZE_MAX);
  const TraceLock lock;
  const ssize_t n = transfer(plan().next("pwritev", path), bytes.size(), [&](size_t max_size) {
    return max_size < bytes.size() ? write_some(fd, bytes.data(), max_size, offset)
                                   : next(fd, parts, count, offset);
  });
  if (n > 0) record_write(fd, path, bytes.substr(0, static_cast<size_t>(n)), offset);
  return n;
}
ssize_t pwritev64(int fd, const iovec* parts, int count, off_t offset)
    __attribute__((alias("pwritev")));

ssize_t sendfile(int to, int from, off_t* offset, size_t size) {
  static auto* const next = real<ssize_t(int, int, off_t*, size_t)>("sendfile");
  const std::string path = path_of(to);
  if (plan().traces() && plan().is_below(path)) {  // the caller must use write() instead
    errno = EINVAL;
    return -1;
  }
  return transfer(plan().next("copy", path, path_of(from)), size,
                  [&](size_t n) { return next(to, from, offset, n); });
}
ssize_t sendfile64(int to, int from, off_t* offset, size_t size) __attribute__((alias("sendfile")));

ssize_t copy_file_range(int from, off_t* from_offset, int to, off_t* to_offset, size_t size,
                        unsigned flags) {
  static auto* const next =
      real<ssize_t(int, off_t*, int, off_t*, size_t, unsigned)>("copy_file_range");
  const std::string path = path_of(to);
  if (plan().traces() && plan().is_below(path)) {
    errno = ENOSYS;
    return -1;
  }
  return transfer(plan().next("copy", path, path_of(from)), size,
                  [&](size_t n) { return next(from, from_offset, to, to_offset, n, flags); });
}

void* mmap(void* address, size_t size, int protection, int flags, int fd, off_t offset) {
  static auto* const next = real<void*(void*, size_t, int, int, int, off_t)>("mmap");
  const FaultKind kind = fd < 0 ? FaultKind::kNone : plan().next("mmap", path_of(fd));
  if (kind == FaultKind::kNone) return next(address, size, protection, flags, fd, offset);
  errno = plan().error();
  return MAP_FAILED;
}
void* mmap64(void* address, size_t size, int protection, int flags, int fd, off_t offset)
    __attribute__((alias("mmap")));

off_t lseek(int fd, off_t offset, int from) {
  static auto* const next = real<off_t(int, off_t, int)>("lseek");
  return unless_faulty(plan().next("lseek", path_of(fd)), [&] { return next(fd, offset, from); });
}
off_t lseek64(int fd, off_t offset, int from) __attribute__((alias("lseek")));

int flock(int fd, int operation) {
  static auto* const next = real<int(int, int)>("flock");
  return unless_faulty(plan().next("flock", path_of(fd)), [&] { return next(fd, operation); });
}

// --- waiting for the disk -----------------------------------------------------------------------

int fsync(int fd) {
  static auto* const next = real<int(int)>("fsync");
  const std::string path = path_of(fd);
  const TraceLock lock;
  const int failed = unless_faulty(plan().next("fsync", path), [&] { return next(fd); });
  if (failed == 0 && plan().is_below(path)) record_sync(fd);
  return failed;
}

int fdatasync(int fd) {
  static auto* const next = real<int(int)>("fdatasync");
  const std::string path = path_of(fd);
  const TraceLock lock;
  const int failed = unless_faulty(plan().next("fsync", path), [&] { return next(fd); });
  if (failed == 0 && plan().is_below(path)) record_sync(fd);
  return failed;
}

int syncfs(int fd) {
  const std::string path = path_of(fd);
  const TraceLock lock;
  // Do not wait for the disk: other programs of this machine write to it too.
  const int failed = unless_faulty(plan().next("syncfs", path), [] { return 0; });
  if (failed == 0 && plan().is_below(path)) record_sync_of_all();
  return failed;
}

int sync_file_range(int fd, off_t offset, off_t size, unsigned flags) {
  static auto* const next = real<int(int, off_t, off_t, unsigned)>("sync_file_range");
  return unless_faulty(plan().next("sync_file_range", path_of(fd)),
                       [&] { return next(fd, offset, size, flags); });
}

// --- names --------------------------------------------------------------------------------------

int renameat2(int from_at, const char* from, int to_at, const char* to, unsigned flags) {
  const std::string old_name = absolute_path(from_at, from), new_name = absolute_path(to_at, to);
  const TraceLock lock;
  const int failed = unless_faulty(plan().next("rename", old_name, new_name), [&] {
    return static_cast<int>(syscall(SYS_renameat2, from_at, from, to_at, to, flags));
  });
  if (failed == 0) record_names(Change::kRename, old_name, new_name);
  return failed;
}
int rename(const char* from, const char* to) { return renameat2(AT_FDCWD, from, AT_FDCWD, to, 0); }
int renameat(int from_at, const char* from, int to_at, const char* to) {
  return renameat2(from_at, from, to_at, to, 0);
}

int linkat(int from_at, const char* from, int to_at, const char* to, int flags) {
  const std::string old_name = absolute_path(from_at, from), new_name = absolute_path(to_at, to);
  const TraceLock lock;
  const int failed = unless_faulty(plan().next("link", old_name, new_name), [&] {
    return static_cast<int>(syscall(SYS_linkat, from_at, from, to_at, to, flags));
  });
  if (failed == 0) record_names(Change::kLink, old_name, new_name);
  return failed;
}
int link(const char* from, const char* to) { return linkat(AT_FDCWD, from, AT_FDCWD, to, 0); }

int unlinkat(int at, const char* path, int flags) {
  const std::string name = absolute_path(at, path);
  const TraceLock lock;
  const char* const family = (flags & AT_REMOVEDIR) != 0 ? "rmdir" : "unlink";
  const int failed = unless_faulty(plan().next(family, name), [&] {
    return static_cast<int>(syscall(SYS_unlinkat, at, path, flags));
  });
  if (failed == 0) record_names(Change::kUnlink, name);
  return failed;
}
int unlink(const char* path) { return unlinkat(AT_FDCWD, path, 0); }
int rmdir(const char* path) { return unlinkat(AT_FDCWD, path, AT_REMOVEDIR); }
int remove(const char* path) {
  if (unlink(path) == 0) return 0;
  return errno == EISDIR ? rmdir(path) : -1;
}

int mkdirat(int at, const char* path, mode_t mode) {
  const std::string name = absolute_path(at, path);
  const TraceLock lock;
  const int failed = unless_faulty(plan().next("mkdir", name), [&] {
    return static_cast<int>(syscall(SYS_mkdirat, at, path, mode));
  });
  if (failed == 0) record_names(Change::kMakeDir, name);
  return failed;
}
int mkdir(const char* path, mode_t mode) { return mkdirat(AT_FDCWD, path, mode); }

// --- length -------------------------------------------------------------------------------------

int ftruncate(int fd, off_t length) {
  static auto* const next = real<int(int, off_t)>("ftruncate");
  const std::string path = path_of(fd);
  const TraceLock lock;
  const int failed = unless_faulty(plan().next("truncate", path), [&] { return next(fd, length); });
  if (failed == 0 && plan().is_below(path)) record_length(fd, length);
  return failed;
}
int ftruncate64(int fd, off_t length) __attribute__((alias("ftruncate")));

int truncate(const char* path, off_t length) {
  const int fd = open(path, O_WRONLY | O_CLOEXEC);
  if (fd < 0) return -1;
  const int failed = ftruncate(fd, length);
  close(fd);
  return failed;
}
int truncate64(const char* path, off_t length) __attribute__((alias("truncate")));

int fallocate(int fd, int mode, off_t offset, off_t size) {
  static auto* const next = real<int(int, int, off_t, off_t)>("fallocate");
  const std::string path = path_of(fd);
  const TraceLock lock;
  const int failed =
      unless_faulty(plan().next("fallocate", path), [&] { return next(fd, mode, offset, size); });
  if (failed == 0 && mode == 0 && plan().is_below(path)) record_length(fd, offset + size);
  return failed;
}
int fallocate64(int fd, int mode, off_t offset, off_t size) __attribute__((alias("fallocate")));

int posix_fallocate(int fd, off_t offset, off_t size) {
  static auto* const next = real<int(int, off_t, off_t)>("posix_fallocate");
  const std::string path = path_of(fd);
  if (plan().next("fallocate", path) != FaultKind::kNone) return plan().error();
  const TraceLock lock;
  const int error = next(fd, offset, size);
  if (error == 0 && plan().is_below(path)) record_length(fd, offset + size);
  return error;
}
int posix_fallocate64(int fd, off_t offset, off_t size) __attribute__((alias("posix_fallocate")));

}  // extern "C"
