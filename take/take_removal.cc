#include "take/take_removal.h"

#include <unistd.h>

#include <string>

#include "base/core/error.h"
#include "base/core/text.h"
#include "base/io/file.h"
#include "base/io/unique_fd.h"
#include "take/logs/log_files.h"
#include "take/logs/mesh_file_layout.h"
#include "take/take_files.h"

namespace v3d::take {
namespace {

namespace fs = std::filesystem;

constexpr const char* kLogExtension = ".lcmlog";
constexpr std::string_view kDeleted = ".deleted-";

}  // namespace

io::Status check_removable(const TakePaths& paths) {
  const auto type = io::entry_type_of(paths.folder);
  if (!type) return tl::make_unexpected(type.error());
  if (*type == fs::file_type::symlink) {
    std::error_code unreadable;
    const std::string target = fs::canonical(paths.folder, unreadable);
    return io::io_error("delete", paths.folder,
                        "it is a symbolic link to " + printable(target) +
                            "; delete the take there, with the folder above it as --dir");
  }
  const auto foreign = foreign_entries(paths);
  if (!foreign) return tl::make_unexpected(foreign.error());
  if (foreign->empty()) return {};
  std::vector<std::string> names;
  for (const std::string& name : *foreign) names.push_back(printable(name));
  return io::io_error("delete", paths.folder,
                      "it contains " + join_names(names) +
                          ", which no verification and no copy includes; move it out of the take");
}

io::Status delete_take(const TakePaths& paths) {
  if (auto removable = check_removable(paths); !removable) return removable;
  const std::string name = paths.folder.filename();
  const InterruptedDeletion rest{name, paths.folder.parent_path() / (std::string(kDeleted) + name)};
  // An earlier take of this name may have been deleted and the deletion interrupted.
  if (auto removed = finish_deletion(rest); !removed) return removed;
  if (auto renamed = io::rename_new(paths.folder, rest.folder); !renamed) return renamed;
  return finish_deletion(rest);
}

io::Result<std::vector<InterruptedDeletion>> interrupted_deletions(const fs::path& takes) {
  const auto entries = io::list_folder(takes);
  if (!entries) return tl::make_unexpected(entries.error());
  std::vector<InterruptedDeletion> deletions;
  for (const fs::path& entry : *entries) {
    const std::string name = entry.filename();
    if (!name.starts_with(kDeleted) || name.size() == kDeleted.size()) continue;
    deletions.push_back({name.substr(kDeleted.size()), entry});
  }
  return deletions;
}

io::Status finish_deletion(const InterruptedDeletion& deletion) {
  V3D_CHECK(deletion.folder.filename().string().starts_with(kDeleted));
  const std::error_code error =
      io::uninterrupted_code([&](std::error_code& code) { fs::remove_all(deletion.folder, code); });
  if (error) return io::io_error("delete", deletion.folder, error.message(), error.value());
  return io::sync_folder(deletion.folder.parent_path());
}

bool may_hold_frames(const TakePaths& paths) {
  const auto entries = io::list_folder(paths.folder);
  if (!entries) return true;
  for (const fs::path& entry : *entries) {
    const std::string name = entry.filename();
    if (entry.extension() != kLogExtension || is_of_log(name, paths.pulses())) continue;
    std::error_code error;
    if (fs::file_size(entry, error) > 0) return true;  // -1 after an error
  }
  return false;
}

io::Result<fs::path> quarantine_take(const TakePaths& paths) {
  const fs::path quarantine = paths.folder.parent_path() / kQuarantineFolder;
  if (auto made = io::create_folders(quarantine); !made) return tl::make_unexpected(made.error());
  const std::string name = paths.folder.filename();
  for (int number = 1;; ++number) {
    const fs::path target = quarantine / (number == 1 ? name : name + "." + std::to_string(number));
    const io::Status moved = io::rename_new(paths.folder, target);
    if (moved) return target;
    if (moved.error().code != EEXIST && moved.error().code != ENOTEMPTY) {
      return tl::make_unexpected(moved.error());
    }
  }
}

void remove_mesh_file_without_meshes(const TakePaths& paths) {
  constexpr uint64_t kEmptyFile =
      mesh_file::kHeaderSize + mesh_file::kIndexHeadSize + mesh_file::kFooterSize;
  std::error_code error;
  if (fs::file_size(paths.mesh(), error) > kEmptyFile) return;  // -1 after an error
  unlink(paths.mesh().c_str());
  rmdir(paths.folder.c_str());  // fails, as intended, when the folder is not empty
}

void remove_empty_log(const fs::path& segment) {
  V3D_CHECK(segment.extension() == kLogExtension);
  std::error_code error;
  if (fs::file_size(segment, error) == 0) unlink(segment.c_str());  // -1 after an error
}

void remove_working_file(const fs::path& file) {
  V3D_CHECK(file.filename().string().starts_with("."));
  unlink(file.c_str());
}

}  // namespace v3d::take
