#include "base/file.h"

#include <fstream>
#include <limits>

#include "base/io/file.h"

namespace v3d {

std::string read_file(const std::filesystem::path& path) {
  return io::value_or_throw(io::read_file(path));
}

std::string read_take_file(const std::filesystem::path& path) {
  return io::value_or_throw(
      io::read_file(path, kMaxTakeTextBytes, io::OpenMode::kReadWithinFolder));
}

void replace_file(const std::filesystem::path& path, std::string_view text) {
  io::throw_if_failed(io::replace_file(path, text));
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
