#include "common/partial_file.h"

#include <unistd.h>

#include <cstdio>
#include <string>
#include <system_error>

#include "base/core/error.h"
#include "base/io/file.h"
#include "base/io/recorded_file.h"

namespace v3d {
namespace {

namespace fs = std::filesystem;

void require_replaceable(const fs::path& file) {
  if (io::value_or_throw(io::type_of(file)) == fs::file_type::directory) {
    throw InputError(file.string() + ": is a folder; expected the name of a file");
  }
  if (is_recorded_file(file)) {
    throw InputError(file.string() + ": is a recorded file of a take; expected another file name");
  }
}

io::Status sync_file(const fs::path& path) {
  const auto file = io::File::open(path, io::OpenMode::kRead);
  return file ? file->sync() : tl::make_unexpected(file.error());
}

}  // namespace

PartialFile::PartialFile(const fs::path& file) : file_(fs::absolute(file)) {
  require_replaceable(file_);
  path_ = file_.parent_path() / ("." + file_.stem().string() + "." + std::to_string(getpid()) +
                                 file_.extension().string());
}

PartialFile::~PartialFile() {
  if (finished_) return;
  std::error_code ignored;
  fs::remove(path_, ignored);
}

void PartialFile::finish() {
  io::throw_if_failed(sync_file(path_));
  if (::rename(path_.c_str(), file_.c_str()) != 0) {
    io::throw_if_failed(io::io_error("replace", file_));
  }
  finished_ = true;
  io::throw_if_failed(io::sync_folder(file_.parent_path()));
}

}  // namespace v3d
