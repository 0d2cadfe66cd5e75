#include "daemon/recorded/take_frames.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <set>

#include "base/config/calib_file.h"
#include "base/core/error.h"
#include "base/core/name.h"
#include "base/image/image_size.h"
#include "take/logs/frame_log.h"
#include "take/logs/log_segments.h"

namespace v3d {
namespace {

bool holds(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

/// Throws InputError for a calibration of another image size: it would project to wrong pixels.
void check_size(SegmentedLog& log, const RigCamera& camera, const std::filesystem::path& calib) {
  const ImageSize calibrated = camera.model.size();
  const ImageSize size = log.frame_size().value_or(calibrated);
  if (size == calibrated) return;
  throw InputError(calib.string() + ": the size of " + camera.name + " is " +
                   format_size(calibrated) + ", but its frames are " + format_size(size));
}

}  // namespace

TakeFrames::TakeFrames(const std::filesystem::path& take, const std::vector<std::string>& cameras)
    : paths_{take}, info_(load_take_info(paths_)) {
  const Rig rig = load_take_calib(paths_);
  for (const std::string& name : cameras.empty() ? info_.cameras : cameras) {
    if (!holds(info_.cameras, name)) {
      throw InputError(paths_.info().string() + ": no camera " + name + "; the take has " +
                       join_names(info_.cameras));
    }
    const int index = find_camera(rig, name);
    if (index < 0) throw InputError(paths_.calib().string() + ": no calibration of " + name);
    rig_.push_back(rig[static_cast<size_t>(index)]);
    cameras_.emplace_back(paths_, name);
    check_size(cameras_.back(), rig_.back(), paths_.calib());
  }
  read_edges();
}

/// Edge times are optional: imported takes have none, and a damaged file must not make the frames
/// unreadable.
void TakeFrames::read_edges() {
  if (is_absent_log(paths_.pulses())) return;
  try {
    for (const PulseMessage& pulse : read_pulses(paths_.pulses())) edges_[pulse.pulse] = pulse.edge;
  } catch (const InputError& error) {
    edges_.clear();
    edges_error_ = error.what();
  }
}

std::vector<std::string> TakeFrames::read_errors() const {
  std::vector<std::string> errors;
  if (!edges_error_.empty()) errors.push_back(edges_error_);
  for (const SegmentedLog& camera : cameras_) {
    errors.insert(errors.end(), camera.read_errors().begin(), camera.read_errors().end());
  }
  return errors;
}

RealtimeInstant TakeFrames::edge_of(int64_t pulse) const {
  const auto found = edges_.find(pulse);
  return found == edges_.end() ? RealtimeInstant() : found->second;
}

std::vector<int64_t> TakeFrames::pulses() const {
  std::set<int64_t> pulses;
  for (const SegmentedLog& camera : cameras_) {
    for (const FrameLabel& label : camera.labels()) pulses.insert(label.pulse);
  }
  return {pulses.begin(), pulses.end()};
}

std::vector<std::optional<SegmentedFrame>> TakeFrames::read(int64_t pulse) {
  std::vector<std::optional<SegmentedFrame>> frames(cameras_.size());
  tbb::parallel_for(size_t{0}, cameras_.size(),
                    [&](size_t i) { frames[i] = cameras_[i].read(pulse); });
  return frames;
}

FrameSet observe_all(int64_t pulse, const std::vector<std::optional<SegmentedFrame>>& frames) {
  FrameSet set;
  set.pulse = pulse;
  for (const std::optional<SegmentedFrame>& frame : frames) {
    if (!frame) continue;
    set.frames.push_back(
        observe(frame->raw.camera, frame->raw.label, frame->raw.image.view(), frame->mask));
  }
  return set;
}

}  // namespace v3d
