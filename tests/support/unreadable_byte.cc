#include "support/unreadable_byte.h"

#include <dlfcn.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <string>

namespace v3d::test {
namespace {

std::atomic<off_t> unreadable = -1;  ///< -1: none
std::filesystem::path within;        ///< set before `unreadable`

bool is_concerned(int fd) {
  const std::filesystem::path file =
      std::filesystem::read_symlink("/proc/self/fd/" + std::to_string(fd));
  const bool is_recorded = file.extension() == ".lcmlog" || file.extension() == ".v3d";
  return is_recorded && (within.empty() || file.parent_path() == within);
}

bool is_hit(int fd, size_t size, off_t offset) {
  const off_t bad = unreadable;
  return bad >= offset && bad < offset + static_cast<off_t>(size) && is_concerned(fd);
}

}  // namespace

UnreadableByte::UnreadableByte(off_t at, const std::filesystem::path& folder) {
  within = folder;
  unreadable = at;
}
UnreadableByte::~UnreadableByte() { unreadable = -1; }

}  // namespace v3d::test

/// Replaces pread() of the C library in this program.
extern "C" ssize_t pread(int fd, void* bytes, size_t size, off_t offset) {
  static auto* const next =
      reinterpret_cast<ssize_t (*)(int, void*, size_t, off_t)>(dlsym(RTLD_NEXT, "pread"));
  if (!v3d::test::is_hit(fd, size, offset)) return next(fd, bytes, size, offset);
  errno = EIO;
  return -1;
}
