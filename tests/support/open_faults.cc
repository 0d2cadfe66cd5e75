#include "support/open_faults.h"

#include <dlfcn.h>
#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdarg>
#include <string>
#include <string_view>

namespace v3d::test {
namespace {

std::atomic<bool> has_no_descriptors = false;
std::atomic<bool> is_full = false;
std::string full_folder;  ///< set before `is_full`

/// The errno with which opening `path` fails; 0: it is not concerned.
int fault(const char* path, int flags) {
  if (has_no_descriptors) return EMFILE;
  const bool is_new = is_full && (flags & O_CREAT) != 0 && access(path, F_OK) != 0;
  return is_new && std::string_view(path).starts_with(full_folder) ? ENOSPC : 0;
}

/// openat() of the C library, unless it fails. `arguments`: those after `flags`.
int open_at(int folder, const char* path, int flags, va_list arguments) {
  static auto* const next =
      reinterpret_cast<int (*)(int, const char*, int, ...)>(dlsym(RTLD_NEXT, "openat"));
  if (const int error = fault(path, flags); error != 0) {
    errno = error;
    return -1;
  }
  const mode_t mode = (flags & O_CREAT) != 0 ? va_arg(arguments, mode_t) : 0;
  return next(folder, path, flags, mode);
}

}  // namespace

NoDescriptorsLeft::NoDescriptorsLeft() : FlagScope(has_no_descriptors) {}
FullDisk::FullDisk(const std::filesystem::path& folder)
    : FlagScope((full_folder = folder / "", is_full)) {}

extern "C" int open(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const int file = open_at(AT_FDCWD, path, flags, arguments);
  va_end(arguments);
  return file;
}

// With it, std::filesystem opens the folder that it lists.
extern "C" int openat(int folder, const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const int file = open_at(folder, path, flags, arguments);
  va_end(arguments);
  return file;
}

}  // namespace v3d::test
