// Reader of the frames of one camera of a recorded take, with the silhouettes that the capture
// daemon would have published. Also loads background models of takes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "capture/segmentation/background.h"
#include "capture/segmentation/segmenter.h"
#include "take/logs/frame_log.h"
#include "take/take.h"

namespace v3d {

/// A raw frame and its silhouette.
struct SegmentedFrame {
  Frame raw;
  Mask mask;
};

/// The background model of `camera`; empty if the take has none. Throws InputError like
/// load_background(), and if the take's folder `background` is a symbolic link.
std::optional<BackgroundModel> load_take_background(const TakePaths& paths,
                                                    const std::string& camera);

/// One thread.
class SegmentedLog {
 public:
  /// Throws InputError if the log is missing or not a log, or if the background model is damaged.
  SegmentedLog(const TakePaths& paths, const std::string& camera);

  const std::vector<FrameLabel>& labels() const { return log_.labels(); }
  /// See FrameLogReader::read_errors().
  const std::vector<std::string>& read_errors() const { return log_.read_errors(); }

  /// The sensor size in the first frame of the log; empty if the log has no frame.
  std::optional<ImageSize> frame_size();

  /// The frame of a pulse and its silhouette; empty if there is no frame, or it is incomplete. A
  /// stored mask is used as it is. Otherwise the frame is segmented by the take's background model,
  /// adapted to the light up to this frame as in live operation, so that the result does not depend
  /// on previous reads. Fast in the order of the log. Throws InputError for a frame with neither
  /// mask nor model.
  std::optional<SegmentedFrame> read(int64_t pulse);

 private:
  /// Adapts the segmenter to the frames before `index`, as in live operation.
  void learn_before(size_t index);
  void learn(int64_t pulse);
  Mask segment(const Frame& raw);

  TakePaths paths_;
  FrameLogReader log_;
  std::unordered_map<int64_t, size_t> index_of_;  ///< first frame in the log, by pulse
  std::optional<Segmenter> segmenter_;
  size_t learnt_ = 0;  ///< the segmenter is adapted to the frames before this index
};

}  // namespace v3d
