// TakeDeletion: deletion of verified takes that have a copy.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "take/take.h"
#include "take/take_files.h"
#include "take/take_listing.h"
#include "take/take_lock.h"

namespace v3d::take {

/// Throws InputError, with the cause and what to do, for a take that must not be deleted: it is
/// being recorded, was not verified or has changed since, is circled, or check_removable() rejects
/// it.
void require_deletable(const TakeListing& take);

/// Excludes other processes from takes and their copies, compares the copies, and deletes takes.
/// One thread.
class TakeDeletion {
 public:
  /// Locks the takes, and their copies in the folder of takes `copies` (empty: no take needs a
  /// copy), for the lifetime of the object. A copy on a read-only file system is not locked, but it
  /// must not be locked by another process. A take that needs no copy is not locked on a full disk.
  ///
  /// Throws InputError when another process records or recovers one of them, deletes it or needs it
  /// as a copy; when a copy does not exist or is the take itself by another path; when the lock of
  /// a take that needs a copy, or of its copy, cannot be created on a full disk: nothing else shows
  /// that a copy is the take itself through another mount; and when require_deletable() rejects a
  /// take.
  TakeDeletion(std::vector<TakePaths> takes, std::filesystem::path copies);

  /// Compares each take with its copy, as missing_in_copy() does. Calls `report` with each line of
  /// an incomplete copy, then throws InputError. Before, throws InputError with the text of a slate
  /// that its copy lacks (text_not_in()). Does nothing when no take needs a copy.
  void compare(const std::function<void(const std::string&)>& report);

  /// Deletes a take of the constructor. Requires compare().
  ///
  /// Comparing many takes needs hours, so this checks again first: throws InputError when
  /// require_deletable() rejects the take now, when its slate has a text that the copy lacks, and
  /// when another file of the take or of its copy was changed or removed since compare(). Throws
  /// std::runtime_error when a file cannot be deleted.
  void remove(const TakePaths& take);

 private:
  /// State of a take and its copy at the time of their comparison.
  struct Compared {
    std::vector<TakeFile> files;                ///< of the take, by its verification
    std::vector<std::optional<TakeFile>> copy;  ///< the same files of the copy; empty: none

    friend bool operator==(const Compared&, const Compared&) = default;
  };

  TakePaths copy_of(const TakePaths& take) const;
  void lock_take(const TakePaths& take);
  void lock_takes();
  void lock_copies();
  Compared state_of(const TakePaths& take) const;
  void require_slate_in_copy(const TakePaths& take) const;

  const std::vector<TakePaths> takes_;
  const std::filesystem::path copies_;
  std::vector<DeletionLock> deletion_locks_;
  std::vector<std::vector<TakeLock>> take_locks_;
  std::map<std::filesystem::path, Compared> compared_;  ///< by the folder of the take
};

}  // namespace v3d::take
