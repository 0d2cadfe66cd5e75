// A temporary folder for a test, removed at destruction. A killed test leaves its folder behind.
// The folder's name holds the process ID, and the next test program removes it.
#pragma once

#include <signal.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

namespace v3d::test {

/// Prefix of a folder's name; the process ID follows.
inline constexpr char kTemporaryPrefix[] = "v3d-test-";

/// The ID of the process that owns a folder of this name; 0 when it is not a temporary folder.
inline pid_t temporary_owner(const std::string& name) {
  if (!name.starts_with(kTemporaryPrefix)) return 0;
  const char* const end = name.data() + name.size();
  pid_t pid = 0;
  const auto number = std::from_chars(name.data() + sizeof(kTemporaryPrefix) - 1, end, pid);
  return number.ec == std::errc() && number.ptr != end && *number.ptr == '-' ? pid : 0;
}

/// Removes the temporary folders in `where` whose processes no longer exist. Errors are ignored.
inline void remove_leftovers(const std::filesystem::path& where) {
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(where, ignored)) {
    const pid_t owner = temporary_owner(entry.path().filename());
    if (owner > 0 && kill(owner, 0) != 0 && errno == ESRCH) {
      std::filesystem::remove_all(entry.path(), ignored);
    }
  }
}

class TemporaryFolder {
 public:
  /// Creates a folder in `where`. Throws std::runtime_error.
  explicit TemporaryFolder(const std::filesystem::path& where = default_parent()) {
    const std::string name = kTemporaryPrefix + std::to_string(getpid()) + "-XXXXXX";
    std::string pattern = where / name;
    if (!mkdtemp(pattern.data())) throw std::runtime_error("mkdtemp");
    path_ = pattern;
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

 private:
  /// The system's temporary folder. The first call of a process removes leftovers there.
  static std::filesystem::path default_parent() {
    static const std::filesystem::path parent = [] {
      std::filesystem::path temporary = std::filesystem::temp_directory_path();
      remove_leftovers(temporary);
      return temporary;
    }();
    return parent;
  }

  std::filesystem::path path_;
};

inline void write_text(const std::filesystem::path& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

}  // namespace v3d::test
