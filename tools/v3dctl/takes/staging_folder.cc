#include "v3dctl/takes/staging_folder.h"

#include <algorithm>
#include <cerrno>
#include <iterator>
#include <system_error>
#include <vector>

#include "base/core/error.h"
#include "base/io/file.h"
#include "base/io/unique_fd.h"
#include "v3dctl/reconstruct/pending_mesh_file.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

/// The regular files in a folder and its folders.
std::vector<fs::path> files_in(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const fs::path& entry : io::value_or_throw(io::list_folder(folder))) {
    const fs::file_type type = io::value_or_throw(io::entry_type_of(entry));
    if (type == fs::file_type::regular) files.push_back(entry);
    if (type != fs::file_type::directory) continue;
    std::ranges::move(files_in(entry), std::back_inserter(files));
  }
  return files;
}

}  // namespace

take::TakeLock StagingFolder::lock(const std::string& take) const {
  constexpr int kMaxAttempts = 10;
  for (int attempt = 1;; ++attempt) {
    io::throw_if_failed(io::create_folders(folder_));
    auto lock = take::TakeLock::acquire({folder_}, take);
    if (lock) return *std::move(lock);
    // Another process has removed the empty folder.
    if (lock.error().code != ENOENT || attempt == kMaxAttempts) io::throw_input_error(lock.error());
  }
}

void StagingFolder::remove_if_empty() const {
  std::error_code not_empty;
  fs::remove(folder_, not_empty);
}

void remove_copies(const fs::path& folder) {
  const std::error_code error =
      io::uninterrupted_code([&](std::error_code& code) { fs::remove_all(folder, code); });
  if (error) throw fs::filesystem_error("cannot remove", folder, error);
}

void remove_shared_names(const fs::path& part) {
  for (const fs::path& file : files_in(part)) {
    if (fs::hard_link_count(file) > 1) fs::remove(file);
  }
}

bool has_hard_links(const fs::path& folder) {
  const fs::path file = folder / ".probe", second = folder / ".probe-2";
  replace_file(file, "");
  fs::remove(second);  // of a run that was killed
  std::error_code error;
  fs::create_hard_link(file, second, error);
  fs::remove(file);
  fs::remove(second);
  return !error;
}

int64_t bytes_in(const fs::path& folder) {
  int64_t bytes = 0;
  for (const fs::path& file : files_in(folder)) bytes += static_cast<int64_t>(fs::file_size(file));
  return bytes;
}

RunFolder::RunFolder(const fs::path& to)
    : name_(fs::path(StagingFolder::kName) / (".run-" + process_suffix())), path_(to / name_) {
  io::throw_if_failed(io::create_folders(path_));
}

RunFolder::~RunFolder() {
  std::error_code ignored;  // a remaining folder has no effect
  fs::remove_all(path_, ignored);
  fs::remove(path_.parent_path(), ignored);
}

}  // namespace v3d::ctl
