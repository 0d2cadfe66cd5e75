// The staging folder of `takes collect`: the parts of takes until they are joined.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "take/take_lock.h"

namespace v3d::ctl {

/// TO/.collect, in the folder of the copies. TO/.collect/TAKE has the parts of a take.
class StagingFolder {
 public:
  /// `to`: the folder of the copies.
  explicit StagingFolder(const std::filesystem::path& to) : folder_(to / kName) {}

  static constexpr const char* kName = ".collect";
  std::filesystem::path of(const std::string& take) const { return folder_ / take; }

  /// Excludes other processes from the parts and the copy of a take. Creates the folder. Throws
  /// InputError while another process holds the lock, with its host and number.
  take::TakeLock lock(const std::string& take) const;
  void remove_if_empty() const;

 private:
  std::filesystem::path folder_;
};

/// Removes parts of takes in the staging folder. Throws std::filesystem::filesystem_error.
void remove_copies(const std::filesystem::path& folder);

/// Removes the names of those files of a part that have a second name. That is one in a collected
/// take, whose staging folder was not removed after the join. rsync writes into existing files, and
/// would change the collected take. Throws InputError or std::filesystem::filesystem_error.
void remove_shared_names(const std::filesystem::path& part);

/// Can the file system of a folder give one file two names? Throws std::runtime_error when no file
/// can be written there.
bool has_hard_links(const std::filesystem::path& folder);

/// Bytes of all files in a folder and its folders. Throws InputError or
/// std::filesystem::filesystem_error.
int64_t bytes_in(const std::filesystem::path& folder);

/// A hidden folder of this process in the staging folder, for files that it needs for a moment.
/// Removes the folder, and the staging folder if it is empty then.
class RunFolder {
 public:
  /// `to`: the folder of the copies. Throws std::runtime_error when the folder cannot be created.
  explicit RunFolder(const std::filesystem::path& to);
  ~RunFolder();
  RunFolder(const RunFolder&) = delete;
  RunFolder& operator=(const RunFolder&) = delete;

  /// Relative to the folder of the copies.
  const std::filesystem::path& name() const { return name_; }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path name_, path_;
};

}  // namespace v3d::ctl
