#include "v3dctl/take_frames.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <set>

#include "base/calib_file.h"
#include "base/error.h"
#include "v3dctl/options.h"

namespace v3d::ctl {
namespace {

bool holds(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

std::optional<Segmenter> segmenter_of(const TakePaths& paths, const std::string& camera) {
  if (!has_background(paths.background(), camera)) return std::nullopt;
  return Segmenter(load_background(paths.background(), camera), SegmentOptions{});
}

std::optional<SegmentedFrame> segment(std::optional<Frame> raw, std::optional<Segmenter>& segmenter,
                                      const TakePaths& paths) {
  if (!raw) return std::nullopt;
  if (raw->mask) {
    Mask mask = *std::move(raw->mask);
    raw->mask.reset();
    return SegmentedFrame{*std::move(raw), std::move(mask)};
  }
  if (!segmenter) {
    throw InputError(
        paths.frames(raw->camera).string() + ": frames without masks, and no background model in " +
        paths.background().string() + ": import with --masks, --background or --background-black");
  }
  if (segmenter->size() != raw->image.size || segmenter->format() != raw->image.format) {
    throw InputError(paths.background().string() + ": the background model of " + raw->camera +
                     " is of other images than the frames: learn it again");
  }
  Mask mask = segmenter->segment(raw->image.view());
  return SegmentedFrame{*std::move(raw), std::move(mask)};
}

}  // namespace

TakeFrames::TakeFrames(const std::filesystem::path& take, const std::vector<std::string>& cameras)
    : paths_{take}, info_(load_take_info(paths_)) {
  const Rig rig = load_calib(paths_.calib());
  for (const std::string& name : cameras.empty() ? info_.cameras : cameras) {
    if (!holds(info_.cameras, name)) {
      throw InputError(paths_.info().string() + ": no camera " + name + "; the take has " +
                       join_names(info_.cameras));
    }
    const int index = find_camera(rig, name);
    if (index < 0) throw InputError(paths_.calib().string() + ": no calibration of " + name);
    rig_.push_back(rig[static_cast<size_t>(index)]);
    cameras_.push_back({FrameLogReader(paths_.frames(name)), segmenter_of(paths_, name)});
  }
}

std::vector<int64_t> TakeFrames::pulses() const {
  std::set<int64_t> pulses;
  for (const OpenCamera& camera : cameras_) {
    for (const FrameLabel& label : camera.log.labels()) pulses.insert(label.pulse);
  }
  return {pulses.begin(), pulses.end()};
}

std::vector<std::optional<SegmentedFrame>> TakeFrames::read(int64_t pulse) {
  std::vector<std::optional<SegmentedFrame>> frames(cameras_.size());
  tbb::parallel_for(size_t{0}, cameras_.size(), [&](size_t i) {
    frames[i] = segment(cameras_[i].log.read(pulse), cameras_[i].segmenter, paths_);
  });
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

std::vector<std::string> cameras_without(const TakeInfo& info,
                                         const std::vector<std::string>& left_out) {
  for (const std::string& name : left_out) {
    if (!holds(info.cameras, name)) {
      throw InputError("--leave-out " + name + ": the take has no such camera; it has " +
                       join_names(info.cameras));
    }
  }
  std::vector<std::string> cameras;
  for (const std::string& name : info.cameras) {
    if (!holds(left_out, name)) cameras.push_back(name);
  }
  if (cameras.empty()) throw InputError("--leave-out: leaves no camera of the take");
  return cameras;
}

}  // namespace v3d::ctl
