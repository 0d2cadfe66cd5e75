#include "daemon/node/folder_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <array>

#include "base/core/error.h"
#include "base/core/printable.h"
#include "base/io/uninterrupted.h"

namespace v3d {
namespace {

/// The owner that the lock file names.
std::string owner_in(int file) {
  std::array<char, 128> text{};
  const ssize_t size = pread(file, text.data(), text.size(), 0);
  return size > 0 ? printable(std::string(text.data(), static_cast<size_t>(size)))
                  : "another daemon";
}

}  // namespace

FolderLock::FolderLock(const std::filesystem::path& folder, const std::string& name,
                       const std::string& owner) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);  // open() reports the error
  const std::filesystem::path path = folder / name;
  file_ = io::uninterrupted(
      [&] { return open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0640); });
  if (file_ < 0) throw InputError(errno_message(path.string()));
  if (io::uninterrupted([&] { return flock(file_, LOCK_EX | LOCK_NB); }) != 0) {
    const bool is_held = errno == EWOULDBLOCK;
    const std::string cause = errno_message("cannot lock " + path.string());
    const std::string holder = owner_in(file_);
    close(file_);
    if (!is_held) throw InputError(cause);
    throw InputError(folder.string() + ": " + holder +
                     " writes its takes here already; every reconstruction node needs a "
                     "takes folder of its own ([storage] takes)");
  }
  const bool written = ftruncate(file_, 0) == 0 && pwrite(file_, owner.data(), owner.size(), 0) ==
                                                       static_cast<ssize_t>(owner.size());
  static_cast<void>(written);  // only used in a message; a full disk is reported elsewhere
}

FolderLock::~FolderLock() { close(file_); }

}  // namespace v3d
