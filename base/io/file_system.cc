#include "base/io/file_system.h"

#include <fcntl.h>
#include <unistd.h>

#include "base/io/uninterrupted.h"
#include "base/io/unique_fd.h"

namespace v3d::io {

Status sync_file_system(const std::filesystem::path& folder) {
  const UniqueFd fd(
      uninterrupted([&] { return ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC); }));
  if (!fd || uninterrupted([&] { return syncfs(fd.get()); }) != 0)
    return io_error("sync the file system of", folder);
  return {};
}

}  // namespace v3d::io
