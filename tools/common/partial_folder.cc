#include "common/partial_folder.h"

#include <unistd.h>

#include <cstdlib>
#include <string>
#include <system_error>

#include "base/core/error.h"
#include "base/io/file.h"

namespace v3d {
namespace {

namespace fs = std::filesystem;

void require_free_name(const fs::path& folder) {
  const auto type = io::value_or_throw(io::entry_type_of(folder));
  if (type == fs::file_type::not_found) return;
  if (type != fs::file_type::directory) {
    throw InputError(folder.string() + ": is a file; expected the name of a new folder");
  }
  if (!io::value_or_throw(io::list_folder(folder)).empty()) {
    throw InputError(folder.string() + ": is not empty; expected a new or an empty folder");
  }
}

fs::path make_beside(const fs::path& folder) {
  std::string pattern = folder.string() + ".partial-XXXXXX";
  if (mkdtemp(pattern.data()) == nullptr) {
    io::throw_input_error(io::io_error("make folder", pattern).value());
  }
  fs::permissions(pattern, fs::perms(0755));
  return pattern;
}

}  // namespace

fs::path normal_folder(const fs::path& folder) {
  const fs::path path = fs::absolute(folder).lexically_normal();
  return path.has_filename() ? path : path.parent_path();
}

PartialFolder::PartialFolder(const fs::path& folder) : folder_(normal_folder(folder)) {
  require_free_name(folder_);
  path_ = make_beside(folder_);
}

PartialFolder::~PartialFolder() {
  if (finished_) return;
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

void PartialFolder::finish() {
  ::rmdir(folder_.c_str());  // fails unless it is an empty folder
  io::throw_if_failed(io::rename_new(path_, folder_));
  finished_ = true;
}

}  // namespace v3d
