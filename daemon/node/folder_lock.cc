#include "daemon/node/folder_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <array>
#include <cerrno>

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
  file_.reset(io::uninterrupted(
      [&] { return open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0640); }));
  if (!file_) throw InputError(errno_message(path.string()));
  if (io::uninterrupted([&] { return flock(file_.get(), LOCK_EX | LOCK_NB); }) != 0) {
    if (errno != EWOULDBLOCK) throw InputError(errno_message("cannot lock " + path.string()));
    throw InputError(folder.string() + ": " + owner_in(file_.get()) +
                     " writes its takes here already; every reconstruction node needs a "
                     "takes folder of its own ([storage] takes)");
  }
  const bool written =
      ftruncate(file_.get(), 0) == 0 &&
      pwrite(file_.get(), owner.data(), owner.size(), 0) == static_cast<ssize_t>(owner.size());
  static_cast<void>(written);  // only used in a message; a full disk is reported elsewhere
}

}  // namespace v3d
