// Preloaded into a daemon (LD_PRELOAD), makes the disk of its takes slow: while the file
// $V3D_SLOW_DISK exists, every write to an event log takes as many milliseconds as stand in it.
#include <dlfcn.h>
#include <sys/uio.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <string_view>

namespace {

bool is_event_log(int fd) {
  char link[64], path[4096];
  std::snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
  const ssize_t length = readlink(link, path, sizeof path);
  return length > 0 && std::string_view(path, static_cast<size_t>(length)).ends_with(".lcmlog");
}

long milliseconds() {
  const char* control = std::getenv("V3D_SLOW_DISK");
  std::FILE* file = control != nullptr ? std::fopen(control, "re") : nullptr;
  if (file == nullptr) return 0;
  long n = 0;
  if (std::fscanf(file, "%ld", &n) != 1) n = 0;
  std::fclose(file);
  return n;
}

}  // namespace

extern "C" ssize_t writev(int fd, const iovec* parts, int count) {
  static const auto real =
      reinterpret_cast<ssize_t (*)(int, const iovec*, int)>(dlsym(RTLD_NEXT, "writev"));
  if (is_event_log(fd)) {
    const timespec pause{0, milliseconds() * 1'000'000};
    nanosleep(&pause, nullptr);
  }
  return real(fd, parts, count);
}
