#include "daemon/recorded/take_frames.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <set>
#include <utility>

#include "base/config/calib_file.h"
#include "base/core/error.h"
#include "base/core/text.h"
#include "base/image/image.h"
#include "base/io/file.h"
#include "take/logs/frame_log.h"
#include "take/logs/log_files.h"

namespace v3d::recorded {
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
  if (take::is_absent_log(paths_.pulses())) return;
  try {
    for (const wire::PulseMessage& pulse : take::read_pulses(paths_.pulses()))
      edges_[pulse.pulse] = pulse.edge;
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
  return read_each(std::vector<std::optional<int64_t>>(cameras_.size(), pulse));
}

std::vector<std::optional<SegmentedFrame>> TakeFrames::read_each(
    std::span<const std::optional<int64_t>> pulses) {
  V3D_CHECK(pulses.size() == cameras_.size());
  std::vector<std::optional<SegmentedFrame>> frames(cameras_.size());
  tbb::parallel_for(size_t{0}, cameras_.size(), [&](size_t i) {
    if (pulses[i]) frames[i] = cameras_[i].read(*pulses[i]);
  });
  return frames;
}

UsedCameras used_cameras(const recon::CompactFrame& frame) {
  return {frame.pulse, frame.cameras, frame.late_cameras};
}

std::vector<std::optional<SegmentedFrame>> read_used(const UsedCameras& used, TakeFrames& take) {
  std::vector<std::optional<int64_t>> pulses;
  for (const RigCamera& camera : take.rig()) {
    auto& pulse = pulses.emplace_back();
    if (!std::ranges::binary_search(used.names, camera.name)) continue;
    pulse = used.pulse + (std::ranges::binary_search(used.late, camera.name) ? 1 : 0);
  }
  return take.read_each(pulses);
}

std::vector<std::string> recorded_cameras(const take::TakePaths& paths) {
  std::vector<std::string> cameras = take::load_take_info(paths).cameras;
  std::erase_if(cameras,
                [&](const std::string& camera) { return !file_exists(paths.frames(camera)); });
  return cameras;
}

recon::FrameSet observe_all(int64_t pulse,
                            const std::vector<std::optional<SegmentedFrame>>& frames) {
  recon::FrameSet set;
  set.pulse = pulse;
  for (const std::optional<SegmentedFrame>& frame : frames) {
    if (!frame) continue;
    set.frames.push_back(
        observe(frame->raw.camera, frame->raw.label, frame->raw.image.view(), frame->mask));
    set.frames.back().background_difference = frame->background_difference;
  }
  return set;
}

std::optional<segmentation::BackgroundModel> load_take_background(const take::TakePaths& paths,
                                                                  const std::string& camera) {
  const auto folder = io::value_or_throw(io::entry_type_of(paths.background()));
  if (folder == std::filesystem::file_type::symlink) {
    throw InputError(paths.background().string() +
                     ": it is a symbolic link; expected a folder of the take");
  }
  if (!segmentation::has_background(paths.background(), camera)) return std::nullopt;
  return segmentation::load_background(paths.background(), camera);
}

SegmentedLog::SegmentedLog(const take::TakePaths& paths, const std::string& camera)
    : paths_(paths), camera_(camera), log_(paths.frames(camera)) {
  for (size_t index = 0; index < labels().size(); ++index) {
    index_of_.emplace(labels()[index].pulse, index);
  }
  if (auto model = load_take_background(paths, camera)) {
    segmenter_.emplace(*std::move(model), segmentation::SegmentOptions{});
  }
}

std::optional<ImageSize> SegmentedLog::frame_size() {
  if (labels().empty()) return std::nullopt;
  const std::optional<Frame> first = read_raw(labels().front().pulse);
  return first ? std::optional(first->sensor_size) : std::nullopt;
}

std::optional<Frame> SegmentedLog::read_raw(int64_t pulse) {
  std::optional<Frame> raw = log_.read(pulse);
  if (!raw) return std::nullopt;
  const std::string log = paths_.frames(camera_).string();
  if (raw->camera != camera_) {
    throw InputError(log + ": has frames of '" + printable(raw->camera) + "'; expected those of " +
                     camera_);
  }
  if (raw->image.size != raw->sensor_size) {
    throw InputError(log + ": the frame of pulse " + std::to_string(pulse) +
                     " is cropped; expected whole images");
  }
  return raw;
}

std::optional<SegmentedFrame> SegmentedLog::read(int64_t pulse) {
  std::optional<Frame> raw = read_raw(pulse);
  if (!raw) return std::nullopt;
  std::optional<Mask> stored = std::exchange(raw->mask, std::nullopt);
  if (stored && !can_segment(*raw)) return SegmentedFrame{*std::move(raw), *std::move(stored)};
  learn_before(index_of_.at(pulse));
  Mask segmented = segment(*raw);
  if (!stored) return SegmentedFrame{*std::move(raw), std::move(segmented)};
  return SegmentedFrame{*std::move(raw), *std::move(stored), std::move(segmented)};
}

void SegmentedLog::learn_before(size_t index) {
  if (!segmenter_) return;
  if (index < after_last_learnt_) {
    segmenter_->restore_plates();
    learnt_ = after_last_learnt_ = 0;
  }
  for (; learnt_ < index; ++learnt_) {
    const int64_t pulse = labels()[learnt_].pulse;
    if (!segmenter_->learns_from(pulse)) continue;
    learn(pulse);
    after_last_learnt_ = learnt_ + 1;
  }
}

void SegmentedLog::learn(int64_t pulse) {
  const std::optional<Frame> raw = read_raw(pulse);
  if (!raw || (raw->mask && !can_segment(*raw))) return;
  segmenter_->learn(pulse, raw->image.view(), segment(*raw));
}

bool SegmentedLog::can_segment(const Frame& raw) const {
  return segmenter_ && segmenter_->size() == raw.image.size &&
         segmenter_->format() == raw.image.format;
}

Mask SegmentedLog::segment(const Frame& raw) {
  if (!segmenter_) {
    throw InputError(
        paths_.frames(raw.camera).string() + ": frames without masks, and no background model in " +
        paths_.background().string() + ": import with --masks, --background or --background-black");
  }
  if (!can_segment(raw)) {
    throw InputError(paths_.background().string() + ": the background model of " + raw.camera +
                     " has another image size or format than the frames: learn it again");
  }
  return segmenter_->segment(raw.image.view());
}

}  // namespace v3d::recorded
