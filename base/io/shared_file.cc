#include "base/io/shared_file.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <system_error>

#include "base/io/recorded_file.h"
#include "base/io/temporary_file.h"

namespace v3d::io {
namespace {

namespace fs = std::filesystem;

/// Gives a new file the mode of the file at `path`, if there is one, and its owner and group where
/// this process may.
Status copy_rights(const fs::path& path, const File& to) {
  struct stat from {};
  if (::stat(path.c_str(), &from) != 0) return errno == ENOENT ? Status{} : io_error("read", path);
  // Only root may give a file to another user. A user may give it to a group of its own.
  const bool is_given = fchown(to.fd(), from.st_uid, from.st_gid) == 0 ||
                        fchown(to.fd(), static_cast<uid_t>(-1), from.st_gid) == 0;
  static_cast<void>(is_given);
  if (fchmod(to.fd(), from.st_mode & 07777) != 0) return io_error("set the mode of", to.path());
  return {};
}

/// `path` is no symbolic link.
Status replace_with_rights(const fs::path& path, std::string_view content) {
  auto file = create_temporary(path);
  if (!file) return tl::make_unexpected(file.error());
  Status status = copy_rights(path, *file);
  if (status) {
    status = file->write(0, {{reinterpret_cast<const uint8_t*>(content.data()), content.size()}});
  }
  status = sync_and_rename(*std::move(file), std::move(status), path);
  return status ? sync_folder(path.parent_path()) : status;
}

}  // namespace

Result<UniqueFd> lock_folder(const fs::path& folder, const std::function<void()>& on_wait) {
  UniqueFd fd(
      uninterrupted([&] { return ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC); }));
  if (!fd) return io_error("lock", folder);
  const auto lock = [&](int operation) {
    return uninterrupted([&] { return flock(fd.get(), operation); }) == 0;
  };
  if (lock(LOCK_EX | LOCK_NB)) return fd;
  if (errno != EWOULDBLOCK) return io_error("lock", folder);
  on_wait();
  if (lock(LOCK_EX)) return fd;
  return io_error("lock", folder);
}

}  // namespace v3d::io

namespace v3d {

void update_file(const std::filesystem::path& path, std::string_view text) {
  const auto target = std::filesystem::weakly_canonical(std::filesystem::absolute(path));
  require_unrecorded(target);
  io::throw_if_failed(io::replace_with_rights(target, text));
}

}  // namespace v3d
