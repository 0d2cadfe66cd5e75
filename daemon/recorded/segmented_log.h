// The frames of one camera of a recorded take with their silhouettes, as the capture daemon would
// have published them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "capture/segmentation/segmenter.h"
#include "take/logs/frame_log.h"
#include "take/take.h"

namespace v3d {

/// A raw frame and its silhouette.
struct SegmentedFrame {
  Frame raw;
  Mask mask;
};

/// One thread.
class SegmentedLog {
 public:
  /// Throws InputError when the log is missing or is none, or the background model is broken.
  SegmentedLog(const TakePaths& paths, const std::string& camera);

  const std::vector<FrameLabel>& labels() const { return log_.labels(); }
  /// FrameLogReader::read_errors()
  const std::vector<std::string>& read_errors() const { return log_.read_errors(); }

  /// Of the sensor, by the first frame of the log; empty where there is none.
  std::optional<ImageSize> frame_size();

  /// Empty where the camera has no (whole) frame of this pulse. A stored mask is taken as it is,
  /// else the take's background model makes it, which has followed the light up to this frame as it
  /// did live: the answer does not depend on what was read before. Going on in the order of the log
  /// is cheap, going back is not. Throws InputError for a frame with neither mask nor model.
  std::optional<SegmentedFrame> read(int64_t pulse);

 private:
  /// Brings the segmenter to where it was when it met this place of the log.
  void learn_before(size_t place);
  void learn(int64_t pulse);
  Mask segment(const Frame& raw);

  TakePaths paths_;
  FrameLogReader log_;
  std::unordered_map<int64_t, size_t> place_of_;  ///< of the first frame of a pulse in the log
  std::optional<Segmenter> segmenter_;
  size_t passed_ = 0;  ///< places of the log that the segmenter has behind it
};

}  // namespace v3d
