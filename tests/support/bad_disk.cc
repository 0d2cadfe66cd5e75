// Fault injection for the disk of a daemon, preloaded with LD_PRELOAD. While the file $V3D_BAD_DISK
// exists, it selects a fault of the event logs, or of the disk:
//   slow N    every write takes N milliseconds
//   broken    every write fails (EIO)
//   full      each log of frames takes 100 bytes more, other files of a take none while it has a
//             file .reserve (ENOSPC). Meshes are on another disk.
//   pulses    every write to the pulse log fails (EIO)
//   forgets   writes succeed, and fsync() fails (EIO)
#include <dlfcn.h>
#include <sys/uio.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <mutex>
#include <set>
#include <string>
#include <string_view>

namespace {

std::string path_of(int fd) {
  char link[64], path[4096];
  std::snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
  const ssize_t length = readlink(link, path, sizeof path);
  return std::string(path, length > 0 ? static_cast<size_t>(length) : 0);
}

/// The path of an event log; empty for another file.
std::string event_log(int fd) {
  const std::string file = path_of(fd);
  return file.ends_with(".lcmlog") ? file : "";
}

struct DiskFault {
  std::string name;
  long milliseconds = 0;
};

DiskFault disk_fault() {
  const char* control = std::getenv("V3D_BAD_DISK");
  std::FILE* file = control != nullptr ? std::fopen(control, "re") : nullptr;
  if (file == nullptr) return {};
  char name[16] = "";
  long n = 0;
  const int read = std::fscanf(file, "%15s %ld", name, &n);
  std::fclose(file);
  return {name, read == 2 ? n : 0};
}

template <class Function>
Function* real(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

/// True for the first call with this descriptor.
bool is_first_of(int fd) {
  static std::mutex mutex;
  static std::set<int> known;
  const std::lock_guard lock(mutex);
  return known.insert(fd).second;
}

/// Is this a file of a take that has its reserved space, and not its meshes?
bool needs_reserved_space(int fd) {
  const std::filesystem::path file = path_of(fd);
  return file.filename() != "mesh.v3d" && std::filesystem::exists(file.parent_path() / ".reserve");
}

}  // namespace

extern "C" ssize_t pwritev(int fd, const iovec* parts, int count, off_t offset) {
  static auto* const next = real<ssize_t(int, const iovec*, int, off_t)>("pwritev");
  const std::string log = event_log(fd);
  const DiskFault fault = disk_fault();
  const bool is_full = fault.name == "full";
  if (log.empty() && !(is_full && needs_reserved_space(fd))) return next(fd, parts, count, offset);
  const timespec pause{0, fault.milliseconds * 1'000'000};
  nanosleep(&pause, nullptr);
  const bool is_pulse_log = log.ends_with("/pulses.lcmlog");
  if (is_full && !is_pulse_log) {
    if (!log.empty() && is_first_of(fd)) return pwrite(fd, parts[0].iov_base, 100, offset);
    errno = ENOSPC;
    return -1;
  }
  const bool fails = fault.name == "broken" || (fault.name == "pulses" && is_pulse_log);
  if (!fails) return next(fd, parts, count, offset);
  errno = EIO;
  return -1;
}

extern "C" int fsync(int fd) {
  static auto* const next = real<int(int)>("fsync");
  if (event_log(fd).empty() || disk_fault().name != "forgets") return next(fd);
  errno = EIO;
  return -1;
}
