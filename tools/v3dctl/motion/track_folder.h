// The task folder of a tracking that several processes share.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "recon/motion/segment_plan.h"
#include "v3dctl/motion/motion_part.h"
#include "v3dctl/motion/take_motion.h"
#include "v3dctl/reconstruct/task_folder.h"

namespace v3d::ctl {

/// A finished shard: the segment of a range of pulses.
struct TrackedShard {
  MotionPart part;
  std::vector<std::string> read_errors;  ///< of its task so far
};

/// `.shards-track-DIGEST` in the take, or beside the result for a folder of meshes. It has, beside
/// the files of TaskFolder,
///   survey.json                   numbers of the pulses, and their qualities as key pulses
///   shard-000012-000040.motion    the segment of the pulses with the indices 12 to 39
class TrackFolder : public TaskFolder {
 public:
  /// Creates the folder, if it does not exist. Throws InputError for an input that cannot be opened
  /// and std::runtime_error for errors of the disk.
  static TrackFolder create(const TrackRequest& request);
  /// Uses an existing folder.
  explicit TrackFolder(std::filesystem::path path) : TaskFolder(std::move(path)) {}

  /// The request, without TrackRequest::out, threads and max_bytes. Throws InputError if another
  /// build of this program created the folder.
  TrackRequest request() const;

  void save_survey(const recon::TakeSurvey& survey) const;
  /// Empty if it is missing or damaged.
  std::optional<recon::TakeSurvey> find_survey() const;

  /// Throws as save_samples().
  void save(const recon::SegmentRange& range, const TrackedShard& shard) const;
  /// Empty if it is missing or damaged.
  std::optional<TrackedShard> find(const recon::SegmentRange& range) const;
  void drop(const recon::SegmentRange& range) const;
};

}  // namespace v3d::ctl
