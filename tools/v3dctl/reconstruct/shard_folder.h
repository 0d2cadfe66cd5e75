// Folder of shards: the state on disk of a reconstruction that several processes share.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "daemon/recorded/take_frames.h"
#include "v3dctl/reconstruct/reconstruct_report.h"
#include "v3dctl/reconstruct/reconstruct_request.h"
#include "v3dctl/reconstruct/task_folder.h"

namespace v3d::ctl {

/// Pulses from one key frame to the next. Reconstructed alone, they have the same bytes as in the
/// whole take.
struct TakeShard {
  int64_t number = 0;           ///< counted from pulse 0, also where the take has no frames there
  std::vector<int64_t> pulses;  ///< increasing
};

/// Divides increasing pulses into shards.
std::vector<TakeShard> shards_of(const std::vector<int64_t>& pulses);

/// The pulses of a finished shard that have a mesh: all that are not oversized.
std::vector<int64_t> pulses_with_meshes(const TakeShard& shard, const ReconstructReport& report);

/// The task folder of a reconstruction, TAKE/.shards-DIGEST. It has, beside the files of
/// TaskFolder,
///   shard-000012.v3d         meshes of a finished shard
///   shard-000012.proxy.v3d   its proxy, where one was requested
class ShardFolder : public TaskFolder {
 public:
  /// Creates the folder for a complete request, if it does not exist. Throws std::runtime_error for
  /// errors of the disk.
  static ShardFolder create(const ReconstructRequest& complete, const recorded::TakeFrames& take);
  /// Uses an existing folder.
  explicit ShardFolder(std::filesystem::path path) : TaskFolder(std::move(path)) {}

  /// The complete request. Throws InputError if another build of this program created the folder.
  ReconstructRequest request() const;

  std::filesystem::path mesh(const TakeShard& shard) const;
  std::filesystem::path proxy(const TakeShard& shard) const;
  /// Saves the measurements of a shard after its mesh file and proxy. Throws as save_samples().
  void save(const TakeShard& shard, const ReconstructReport& report) const;
  /// Measurements of a finished shard; empty if it is missing or damaged. `empty`: empty_report()
  /// of the request.
  std::optional<ReconstructReport> find(const TakeShard& shard,
                                        const ReconstructReport& empty) const;
  void drop(const TakeShard& shard) const;
  /// Numbers of the shards that are finished according to the file names.
  std::set<int64_t> saved() const;

 private:
  std::vector<std::filesystem::path> files(const TakeShard& shard, bool with_proxy) const;
};

}  // namespace v3d::ctl
