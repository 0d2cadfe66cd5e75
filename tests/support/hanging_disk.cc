// Fault injection for a disk that does not answer, preloaded with LD_PRELOAD. While the file
// $V3D_HANGING_DISK exists, every call of the program that opens, examines, lists or reads
// something below the folder $V3D_HANGING_FOLDER waits.
#include <dirent.h>
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <string_view>

namespace {

template <class Function>
Function* real(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

bool hangs() {
  const char* const control = std::getenv("V3D_HANGING_DISK");
  return control != nullptr && syscall(SYS_access, control, F_OK) == 0;
}

void wait_for(std::string_view path) {
  const char* const folder = std::getenv("V3D_HANGING_FOLDER");
  if (folder == nullptr || !path.starts_with(folder)) return;
  const timespec pause{0, 5'000'000};
  while (hangs()) nanosleep(&pause, nullptr);
}

void wait_for(int fd) {
  if (!hangs()) return;
  char link[64], path[4096];
  std::snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
  const ssize_t length = readlink(link, path, sizeof path);
  if (length > 0) wait_for(std::string_view(path, static_cast<size_t>(length)));
}

/// The optional third or fourth argument of open() and openat().
mode_t mode_of(int flags, va_list arguments) {
  return (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(arguments, mode_t) : 0;
}

using Open = int(const char*, int, ...);
using OpenAt = int(int, const char*, int, ...);
using Stat = int(const char*, struct stat*);
using StatAt = int(int, const char*, struct stat*, int);

}  // namespace

#define V3D_HANGING_OPEN(name)                            \
  extern "C" int name(const char* path, int flags, ...) { \
    static auto* const next = real<Open>(#name);          \
    va_list arguments;                                    \
    va_start(arguments, flags);                           \
    const mode_t mode = mode_of(flags, arguments);        \
    va_end(arguments);                                    \
    wait_for(path);                                       \
    return next(path, flags, mode);                       \
  }
V3D_HANGING_OPEN(open)
V3D_HANGING_OPEN(open64)

#define V3D_HANGING_OPENAT(name)                                      \
  extern "C" int name(int folder, const char* path, int flags, ...) { \
    static auto* const next = real<OpenAt>(#name);                    \
    va_list arguments;                                                \
    va_start(arguments, flags);                                       \
    const mode_t mode = mode_of(flags, arguments);                    \
    va_end(arguments);                                                \
    wait_for(path);                                                   \
    return next(folder, path, flags, mode);                           \
  }
V3D_HANGING_OPENAT(openat)
V3D_HANGING_OPENAT(openat64)

#define V3D_HANGING_STAT(name)                                         \
  extern "C" int name(const char* path, struct stat* state) noexcept { \
    static auto* const next = real<Stat>(#name);                       \
    wait_for(path);                                                    \
    return next(path, state);                                          \
  }
V3D_HANGING_STAT(stat)
V3D_HANGING_STAT(lstat)

extern "C" int fstatat(int folder, const char* path, struct stat* state, int flags) noexcept {
  static auto* const next = real<StatAt>("fstatat");
  wait_for(path);
  return next(folder, path, state, flags);
}

extern "C" DIR* opendir(const char* path) {
  static auto* const next = real<DIR*(const char*)>("opendir");
  wait_for(path);
  return next(path);
}

extern "C" ssize_t pread(int fd, void* bytes, size_t size, off_t offset) {
  static auto* const next = real<ssize_t(int, void*, size_t, off_t)>("pread");
  wait_for(fd);
  return next(fd, bytes, size, offset);
}
