#include "daemon/node/folder_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <array>

#include "base/error.h"
#include "base/io/uninterrupted.h"
#include "base/printable.h"

namespace v3d {
namespace {

/// Who says in the file that the folder is his.
std::string owner_in(int file) {
  std::array<char, 128> text{};
  const ssize_t size = pread(file, text.data(), text.size(), 0);
  return size > 0 ? printable(std::string(text.data(), static_cast<size_t>(size)))
                  : "another daemon";
}

}  // namespace

FolderLock::FolderLock(const std::filesystem::path& folder, const std::string& name,
                       const std::string& who) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);  // what follows tells what is wrong
  const std::filesystem::path path = folder / name;
  file_ = io::uninterrupted(
      [&] { return open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0640); });
  if (file_ < 0) throw InputError(errno_message(path.string()));
  if (flock(file_, LOCK_EX | LOCK_NB) != 0) {
    const std::string owner = owner_in(file_);
    close(file_);
    throw InputError(folder.string() + ": " + owner +
                     " writes its takes here already; every node of the reconstruction needs a "
                     "takes folder of its own ([storage] takes)");
  }
  const bool written = ftruncate(file_, 0) == 0 &&
                       pwrite(file_, who.data(), who.size(), 0) == static_cast<ssize_t>(who.size());
  static_cast<void>(written);  // a name for a message: a full disk is told of elsewhere
}

FolderLock::~FolderLock() { close(file_); }

}  // namespace v3d
