// Recorded frames with silhouettes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "base/geometry/camera_model.h"
#include "capture/segmentation/background.h"
#include "capture/segmentation/segmenter.h"
#include "recon/pipeline/compact_frame.h"
#include "recon/pipeline/frame_set.h"
#include "take/logs/frame_log.h"
#include "take/take.h"

namespace v3d::recorded {

// Reader of the frames of one camera of a recorded take, with the silhouettes that the capture
// daemon would have published. Also loads background models of takes.

/// A raw frame and its silhouette.
struct SegmentedFrame {
  Frame raw;
  Mask mask;
  /// Of a stored mask: the segmentation by the take's background model, see
  /// Frame::background_difference.
  std::optional<Mask> background_difference{};
};

/// The background model of `camera`; empty if the take has none. Throws InputError like
/// load_background(), and if the take's folder `background` is a symbolic link.
std::optional<segmentation::BackgroundModel> load_take_background(const take::TakePaths& paths,
                                                                  const std::string& camera);

/// One thread.
class SegmentedLog {
 public:
  /// Throws InputError if the log is missing or not a log, or if the background model is damaged.
  SegmentedLog(const take::TakePaths& paths, const std::string& camera);

  const std::vector<FrameLabel>& labels() const { return log_.labels(); }
  /// See FrameLogReader::read_errors().
  const std::vector<std::string>& read_errors() const { return log_.read_errors(); }

  /// The sensor size in the first frame of the log; empty if the log has no frame.
  std::optional<ImageSize> frame_size();

  /// The frame of a pulse and its silhouette; empty if there is no frame, or it is incomplete. The
  /// frame is segmented by the take's background model, adapted to the light up to this frame as in
  /// live operation, so that the result does not depend on previous reads. A stored mask is used as
  /// it is; the segmentation is then the background difference, if there is a model of the frame's
  /// size and format. Fast in the order of the log; backward, every 32nd frame makes it segment the
  /// frames again from which the model learns. Throws InputError for a frame with neither mask nor
  /// model, for one of another camera, and for a cropped one.
  std::optional<SegmentedFrame> read(int64_t pulse);

 private:
  std::optional<Frame> read_raw(int64_t pulse);
  /// Adapts the segmenter to the frames before `index`, as in live operation.
  void learn_before(size_t index);
  void learn(int64_t pulse);
  bool can_segment(const Frame& raw) const;
  Mask segment(const Frame& raw);

  take::TakePaths paths_;
  std::string camera_;
  take::FrameLogReader log_;
  std::unordered_map<int64_t, size_t> index_of_;  ///< first frame in the log, by pulse
  std::optional<segmentation::Segmenter> segmenter_;
  size_t learnt_ = 0;  ///< the segmenter is adapted to the frames before this index
  /// The index after the last frame that changed the segmenter: it is also adapted to the frames
  /// before any index from this one to `learnt_`.
  size_t after_last_learnt_ = 0;
};

// Reader of the frames of all cameras of a recorded take, with the silhouettes that the capture
// daemon would have published.

/// One caller at a time; works on several cameras in parallel.
class TakeFrames {
 public:
  /// Opens the logs of `cameras` (empty: all cameras of the take). Throws InputError if `take` is
  /// not a take, a camera is unknown, has no calibration or one of another image size, or a file is
  /// not a log.
  TakeFrames(const std::filesystem::path& take, const std::vector<std::string>& cameras);

  const take::TakeInfo& info() const { return info_; }
  const take::TakePaths& paths() const { return paths_; }
  /// The calibration of the opened cameras, in the order of take.toml.
  const Rig& rig() const { return rig_; }
  /// The pulses of which at least one opened camera has a frame, ascending.
  std::vector<int64_t> pulses() const;

  /// The time of the pulse in pulses.lcmlog of the take; 0 if unknown.
  RealtimeInstant edge_of(int64_t pulse) const;

  /// SegmentedLog::read() for each opened camera.
  std::vector<std::optional<SegmentedFrame>> read(int64_t pulse);
  /// The same with a pulse of its own for each opened camera; empty: its frame is not read.
  std::vector<std::optional<SegmentedFrame>> read_each(
      std::span<const std::optional<int64_t>> pulses);

  /// Read errors so far: lines with path and cause.
  std::vector<std::string> read_errors() const;

 private:
  void read_edges();

  take::TakePaths paths_;
  take::TakeInfo info_;
  Rig rig_;
  std::vector<SegmentedLog> cameras_;
  std::unordered_map<int64_t, RealtimeInstant> edges_;
  std::string edges_error_;  ///< empty: pulses.lcmlog was read, or is absent
};

/// The cameras whose images made the surface of a pulse.
struct UsedCameras {
  int64_t pulse = 0;
  std::vector<std::string> names;  ///< ascending
  std::vector<std::string> late;  ///< of `names`, those with the image of the next pulse; ascending
};
UsedCameras used_cameras(const recon::CompactFrame& frame);

/// The raw frames that made a surface, one for each opened camera; of a late camera that of the
/// next pulse. Empty for a camera that was not used, or whose frame cannot be read.
std::vector<std::optional<SegmentedFrame>> read_used(const UsedCameras& used, TakeFrames& take);

/// The cameras of a take that have raw frames.
std::vector<std::string> recorded_cameras(const take::TakePaths& paths);

/// The frame set of all present frames, by observe(), with their background differences. Copies the
/// masks.
recon::FrameSet observe_all(int64_t pulse,
                            const std::vector<std::optional<SegmentedFrame>>& frames);

}  // namespace v3d::recorded
