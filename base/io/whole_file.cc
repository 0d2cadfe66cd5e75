#include "base/io/whole_file.h"

#include "base/core/error.h"
#include "base/io/file.h"
#include "base/io/recorded_file.h"

namespace v3d {

bool file_exists(const std::filesystem::path& path) {
  return io::value_or_throw(io::type_of(path)) != std::filesystem::file_type::not_found;
}

std::string read_file(const std::filesystem::path& path) {
  return io::value_or_throw(io::read_file(path));
}

std::string read_take_file(const std::filesystem::path& path) {
  return io::value_or_throw(
      io::read_file(path, kMaxTakeTextBytes, io::OpenMode::kReadWithinFolder));
}

void replace_file(const std::filesystem::path& path, std::string_view text) {
  if (is_recorded_file(path)) {
    throw InputError(path.string() + ": is a recorded file of a take; expected another file name");
  }
  io::throw_if_failed(io::replace_file(path, text));
}

}  // namespace v3d
