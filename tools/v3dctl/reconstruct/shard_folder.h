// Folder of shards: the state on disk of a reconstruction that several processes share.
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "base/io/unique_fd.h"
#include "v3dctl/reconstruct/reconstruct_report.h"
#include "v3dctl/reconstruct/reconstruct_request.h"

namespace v3d::ctl {

/// Pulses from one key frame to the next. Reconstructed alone, they have the same bytes as in the
/// whole take.
struct Shard {
  int64_t number = 0;           ///< counted from pulse 0, also where the take has no frames there
  std::vector<int64_t> pulses;  ///< increasing
};

/// Divides increasing pulses into shards.
std::vector<Shard> shards_of(const std::vector<int64_t>& pulses);

/// The pulses of a finished shard that have a mesh: all that are not oversized.
std::vector<int64_t> pulses_with_meshes(const Shard& shard, const ReconstructReport& report);

/// TAKE/.shards-DIGEST:
///   request.json        everything that the result depends on; DIGEST is its checksum
///   shard-000012.v3d    meshes of a finished shard
///   shard-000012.proxy.v3d   its proxy, where one was requested
///   shard-000012.json   its measurements, and a checksum of these files
///   error-*             an error that a retry cannot resolve, one line
///   task-*.log          stderr of the tasks
/// The digest prevents joining shards of other takes, options or programs. Files are replaced
/// atomically. Several processes, also on several hosts, may use one folder.
class ShardFolder {
 public:
  /// Creates the folder for a complete request, if it does not exist. Throws std::runtime_error for
  /// errors of the disk.
  static ShardFolder create(const ReconstructRequest& complete, const recorded::TakeFrames& take);
  /// Uses an existing folder.
  explicit ShardFolder(std::filesystem::path path) : path_(std::move(path)) {}

  const std::filesystem::path& path() const { return path_; }
  std::string digest() const;

  /// The complete request. Throws InputError if another build of this program created the folder.
  ReconstructRequest request() const;

  std::filesystem::path mesh(const Shard& shard) const;
  std::filesystem::path proxy(const Shard& shard) const;
  /// Saves the measurements of a shard after its mesh file and proxy. Throws std::runtime_error,
  /// and no InputError, for errors of the disk and when one of these files is missing: another run
  /// drops the shards of tasks that outlive a killed run.
  void save(const Shard& shard, const ReconstructReport& report) const;
  /// Measurements of a finished shard; empty if it is missing or damaged. `empty`: empty_report()
  /// of the request.
  std::optional<ReconstructReport> find(const Shard& shard, const ReconstructReport& empty) const;
  void drop(const Shard& shard) const;
  /// Numbers of the shards that are finished according to the file names.
  std::set<int64_t> saved() const;

  /// Errors of tasks that a retry cannot resolve.
  void save_error(const std::string& reason) const;
  std::optional<std::string> saved_error() const;
  /// Removes the errors and the task logs of an earlier run.
  void remove_messages() const;

  void remove() const;
  /// Removes the folders of runs with other options. A folder stays unless its lock can be taken,
  /// because a process may still use it.
  void remove_others() const;

 private:
  std::filesystem::path report(const Shard& shard) const;
  /// Of the files of a shard and `samples`, the JSON of its measurements.
  std::string checksum(const Shard& shard, const nlohmann::ordered_json& samples,
                       bool with_proxy) const;

  std::filesystem::path path_;
};

/// Lock of a folder of shards (flock(2) on its file `lock`), held until destruction. It ensures
/// that one process at a time coordinates the tasks of a folder.
class ShardFolderLock {
 public:
  enum class State {
    kHeld,           ///< by this object
    kHeldByAnother,  ///< by another process or object
    kUnknown,        ///< the file could not be opened, or its disk has no locks
  };

  explicit ShardFolderLock(const ShardFolder& folder);

  State state() const { return state_; }
  /// Path and cause if the file could not be opened; otherwise empty.
  const std::string& error() const { return error_; }

 private:
  io::UniqueFd fd_;
  State state_ = State::kUnknown;
  std::string error_;
};

}  // namespace v3d::ctl
