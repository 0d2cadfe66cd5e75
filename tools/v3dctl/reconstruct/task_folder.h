// Task folder: the state on disk of a command whose work several processes share.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/io/unique_fd.h"
#include "daemon/recorded/take_frames.h"

namespace v3d::ctl {

/// PARENT/.shards-DIGEST:
///   request.json        everything that the result depends on; DIGEST is its checksum
///   shard-NAME.json     measurements of a finished shard, and a checksum of these and its files
///   error-*             an error that a retry cannot resolve, one line
///   task-*.log          stderr of the tasks
/// The digest prevents joining shards of other input, options or programs. Files are replaced
/// atomically. Several processes, also on several hosts, may use one folder.
class TaskFolder {
 public:
  /// Creates the folder PARENT/PREFIX<digest>, if it does not exist. `prefix`: begins with
  /// ".shards-". `request`: the complete request. `inputs`: the state of the files that it reads
  /// (input_state()). Throws std::runtime_error for errors of the disk.
  static TaskFolder create(const std::filesystem::path& parent, const std::string& prefix,
                           const nlohmann::ordered_json& request,
                           const nlohmann::ordered_json& inputs);
  /// Uses an existing folder.
  explicit TaskFolder(std::filesystem::path path) : path_(std::move(path)) {}

  const std::filesystem::path& path() const { return path_; }
  std::string digest() const;

  /// The `request` of create(). Throws InputError if another build of this program created the
  /// folder, and when it has no request.
  nlohmann::ordered_json saved_request() const;

  /// Saves the measurements of a shard after its `files`. Throws std::runtime_error, and no
  /// InputError, for errors of the disk and when one of these files is missing: another run drops
  /// the shards of tasks that outlive a killed run.
  void save_samples(const std::string& shard, std::span<const std::filesystem::path> files,
                    const nlohmann::ordered_json& samples) const;
  /// Measurements of a finished shard; empty if they or its files are missing or damaged.
  std::optional<nlohmann::ordered_json> find_samples(
      const std::string& shard, std::span<const std::filesystem::path> files) const;
  void drop(const std::string& shard, std::span<const std::filesystem::path> files) const;
  /// Names of the shards that are finished according to the file names.
  std::vector<std::string> saved_shards() const;
  /// PATH/shard-SHARDEND
  std::filesystem::path shard_file(const std::string& shard, std::string_view end) const;

  /// Errors of tasks that a retry cannot resolve.
  void save_error(const std::string& reason) const;
  std::optional<std::string> saved_error() const;
  /// Removes the errors and the task logs of an earlier run.
  void remove_messages() const;

  void remove() const;
  /// Removes the folders of the same prefix that runs with other options left behind. A folder
  /// stays unless its lock can be taken, because a process may still use it.
  void remove_others() const;

 private:
  std::filesystem::path path_;
};

/// The state of an input file: its path from `folder`, size and time. Reading recordings would take
/// too long.
nlohmann::ordered_json input_state(const std::filesystem::path& path,
                                   const std::filesystem::path& folder);
/// input_state() of all files of a take that a reconstruction reads.
nlohmann::ordered_json input_states(const recorded::TakeFrames& take);

/// Lock of a task folder (flock(2) on its file `lock`), held until destruction. It ensures that one
/// process at a time coordinates the tasks of a folder.
class ShardFolderLock {
 public:
  enum class State {
    kHeld,           ///< by this object
    kHeldByAnother,  ///< by another process or object
    kUnknown,        ///< the file could not be opened, or its disk has no locks
  };

  explicit ShardFolderLock(const TaskFolder& folder);

  State state() const { return state_; }
  /// Path and cause if the file could not be opened; otherwise empty.
  const std::string& error() const { return error_; }

 private:
  io::UniqueFd fd_;
  State state_ = State::kUnknown;
  std::string error_;
};

}  // namespace v3d::ctl
