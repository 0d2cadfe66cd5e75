#include "base/file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <fstream>
#include <limits>
#include <sstream>
#include <stdexcept>

#include "base/error.h"

namespace v3d {
namespace {

/// A file descriptor that closes itself.
class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() {
    if (fd_ >= 0) {
      close(fd_);
    }
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return fd_; }

 private:
  int fd_;
};

bool write_all(int fd, std::string_view text) {
  while (!text.empty()) {
    const ssize_t n = write(fd, text.data(), text.size());
    if (n < 0 && errno != EINTR) {
      return false;
    }
    text.remove_prefix(n > 0 ? static_cast<size_t>(n) : 0);
  }
  return true;
}

void sync_folder(const std::filesystem::path& folder) {
  const Descriptor fd(
      open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (fd.get() >= 0) {
    fsync(fd.get());
  }
}

}  // namespace

std::string read_file(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream text;
  // Of an empty file it inserts nothing, which is a failure, but not a bad one.
  if (!in || std::filesystem::is_directory(path) || (text << in.rdbuf()).bad()) {
    throw InputError(errno_message("cannot read " + path.string()));
  }
  return text.str();
}

void replace_file(const std::filesystem::path& path, std::string_view text) {
  const std::filesystem::path part = path.string() + ".part";
  {
    const Descriptor fd(open(part.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644));
    if (fd.get() < 0 || !write_all(fd.get(), text) || fsync(fd.get()) != 0) {
      throw std::runtime_error(errno_message("cannot write " + part.string()));
    }
  }
  if (rename(part.c_str(), path.c_str()) != 0) {
    throw std::runtime_error(errno_message("cannot replace " + path.string()));
  }
  sync_folder(path.parent_path());
}

int64_t available_memory() {
  std::ifstream in("/proc/meminfo");
  std::string key;
  int64_t kibibytes = 0;
  for (std::string unit; in >> key >> kibibytes; std::getline(in, unit)) {
    if (key == "MemAvailable:") {
      return kibibytes * 1024;
    }
  }
  return std::numeric_limits<int64_t>::max();
}

}  // namespace v3d
