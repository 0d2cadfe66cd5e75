#include "v3dctl/reconstruct/take_surfaces.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <map>
#include <utility>

#include "base/core/time.h"
#include "base/geometry/rigid_transform.h"
#include "base/image/mask_operations.h"
#include "recon/hull/voxel_grid.h"
#include "v3dctl/options.h"

namespace v3d::ctl {

TakeSilhouetteRepair::TakeSilhouetteRepair(const Rig& rig, const recon::ReconstructOptions& options)
    : rig_(rig),
      repair_(rig, options.bounds, recon::voxel_for_repair(options.bounds, options.voxel_m),
              options.min_views),
      views_(rig.size()) {
  tbb::parallel_for(size_t{0}, rig.size(), [&](size_t i) {
    views_[i] = recon::bounds_mask(options.bounds, rig_[i].model);
  });
}

/// Clears the masks outside the view of the bounds. Result: null for a camera without a usable
/// mask.
std::vector<const Mask*> TakeSilhouetteRepair::limit_to_view(SegmentedFrames& frames) const {
  std::vector<const Mask*> masks(views_.size(), nullptr);
  for (size_t c = 0; c < frames.size(); ++c) {
    if (!frames[c] || frames[c]->mask.size() != views_[c].size()) continue;
    frames[c]->mask = intersection_of(std::move(frames[c]->mask), views_[c]);
    masks[c] = &frames[c]->mask;
  }
  return masks;
}

recon::RepairedSilhouettes TakeSilhouetteRepair::compare(const SegmentedFrames& frames,
                                                         std::span<const Mask* const> masks,
                                                         const recon::NeighbourMasks& neighbours) {
  std::vector<const Frame*> images;
  for (size_t c = 0; c < frames.size(); ++c) images.push_back(masks[c] ? &frames[c]->raw : nullptr);
  return repair_.repair(masks, images, neighbours);
}

void TakeSilhouetteRepair::set_previous(int64_t pulse, SegmentedFrames frames) {
  previous_ = compare(frames, limit_to_view(frames), {}).alone;
  previous_pulse_ = pulse;
}

void TakeSilhouetteRepair::repair(int64_t pulse, SegmentedFrames& frames, SegmentedFrames& next) {
  const std::vector<const Mask*> masks = limit_to_view(frames);
  const std::vector<const Mask*> after = limit_to_view(next);
  std::vector<const Mask*> before;
  if (is_previous(pulse - 1)) {
    for (const auto& mask : previous_) before.push_back(mask ? &*mask : nullptr);
  }
  recon::RepairedSilhouettes repaired = compare(frames, masks, {.before = before, .after = after});
  for (const size_t c : repaired.shown_later) {
    frames[c]->raw = next[c]->raw;  // its label is that of the next pulse
    frames[c]->background_difference = next[c]->background_difference;
  }
  for (size_t c = 0; c < frames.size(); ++c) {
    if (masks[c] == nullptr) continue;
    if (repaired.masks[c]) {
      frames[c]->mask = *repaired.masks[c];
    } else {
      frames[c].reset();
    }
  }
  previous_ = std::move(repaired.alone);
  previous_pulse_ = pulse;
  for (const recon::SilhouetteFault& fault : repaired.faults) {
    faults_.push_back({pulse, rig_[fault.camera].name, fault});
  }
}

LivePulseRepair::LivePulseRepair(const Rig& rig, const recon::ReconstructOptions& options,
                                 std::vector<int64_t> pulses)
    : rig_(rig), repair_(rig, options), pulses_(std::move(pulses)) {}

void LivePulseRepair::repair(recon::FrameSet& set, SegmentedFrames& frames) {
  if (!std::ranges::binary_search(pulses_, set.pulse)) return;
  const auto repaired = repair_.repair(set);
  for (const recon::ReplacedMask& replaced : repaired->replaced) {
    auto& frame = frames[static_cast<size_t>(find_camera(rig_, replaced.camera))];
    const auto kept = std::ranges::find(set.frames, replaced.camera, &Frame::camera);
    if (kept != set.frames.end()) {
      frame->mask = *kept->mask;
    } else {
      frame.reset();
    }
  }
  for (const recon::SilhouetteFault& fault : repaired->faults) {
    faults_.push_back({set.pulse, rig_[fault.camera].name, fault});
  }
}

std::vector<std::string> fault_lines(const std::vector<PulseFault>& faults) {
  std::map<std::string, std::array<int64_t, 4>> counts;
  for (const PulseFault& fault : faults) {
    ++counts[fault.camera][static_cast<size_t>(fault.fault.kind)];
  }
  std::vector<std::string> lines;
  for (const auto& [camera, count] : counts) {
    const auto& [missing, phantom, whole, late] = count;
    std::string parts;
    const auto add = [&](int64_t n, const std::string& text) {
      if (n > 0) parts += (parts.empty() ? "" : ", ") + text;
    };
    add(missing, count_of(missing, "missing piece"));
    add(phantom, count_of(phantom, "phantom piece"));
    add(whole, "left out of " + count_of(whole, "frame"));
    add(late, count_of(late, "frame") + " a pulse late");
    lines.push_back(camera + ": " + parts);
  }
  return lines;
}

namespace {

/// Whether a camera of the rig has no frame that takes part (recon::usable_frames()).
bool lacks_camera(const Rig& rig, const SegmentedFrames& frames) {
  for (size_t c = 0; c < rig.size(); ++c) {
    if (!frames[c] || frames[c]->mask.size() != rig[c].model.size()) return true;
  }
  return false;
}

}  // namespace

TakeSurface copy_of_input(const recon::FrameSetJob& work) {
  TakeSurface copy;
  copy.work = recon::FrameSetJob(work.set);
  copy.work.live_passes = work.live_passes;
  return copy;
}

TakeInput::TakeInput(recorded::TakeFrames& take, const std::map<int64_t, int>& passes,
                     TakeSilhouetteRepair* repair, LivePulseRepair* live_repair)
    : take_(take),
      passes_(passes),
      repair_(repair),
      live_repair_(live_repair),
      pulses_(take.pulses()) {}

TakeSurface TakeInput::read(int64_t pulse) {
  const MonotonicInstant begin = Monotonic::now();
  TakeSurface made;
  if (repair_ != nullptr) set_previous_of(pulse);
  made.frames = pulse == next_pulse_ ? std::move(next_) : take_.read(pulse);
  made.lacks_camera = lacks_camera(take_.rig(), made.frames);
  if (repair_ != nullptr) repair(pulse, made.frames);
  made.work = recon::FrameSetJob(observe_all(pulse, made.frames));
  if (live_repair_ != nullptr) live_repair_->repair(made.work.set, made.frames);
  made.work.set.exposure = take_.edge_of(pulse);
  if (const auto found = passes_.find(pulse); found != passes_.end()) {
    made.work.live_passes = found->second;
  }
  made.segment_ms = recon::milliseconds_since(begin);
  return made;
}

/// Reads the pulse before, where a shard begins.
void TakeInput::set_previous_of(int64_t pulse) {
  if (!std::ranges::binary_search(pulses_, pulse - 1) || repair_->is_previous(pulse - 1)) return;
  repair_->set_previous(pulse - 1, take_.read(pulse - 1));
}

void TakeInput::repair(int64_t pulse, SegmentedFrames& frames) {
  next_pulse_ = pulse + 1;
  next_ = take_.read(next_pulse_);
  repair_->repair(pulse, frames, next_);
}

TakeSurfaces::TakeSurfaces(recon::Reconstructor& reconstructor, std::vector<int64_t> pulses,
                           ReadInput read, bool smooth)
    : reconstructor_(reconstructor),
      pulses_(std::move(pulses)),
      read_(std::move(read)),
      smooth_(smooth) {}

TakeSurface TakeSurfaces::make(int64_t pulse) {
  if (!smooth_) {
    TakeSurface made = read_(pulse);
    reconstructor_.make_surface(made.work);
    return made;
  }
  constexpr int kWindowReach = 2;
  std::erase_if(window_, [&](const auto& entry) {
    return entry.first < pulse - kWindowReach || entry.first > pulse + kWindowReach;
  });
  for (int64_t p = pulse - kWindowReach; p <= pulse + kWindowReach; ++p) make_hull(p);
  for (int64_t p = pulse - 1; p <= pulse + 1; ++p) deform(p);
  WindowEntry& now = window_.at(pulse);
  TakeSurface made = std::move(now.surface);
  const MonotonicInstant smoothing = Monotonic::now();
  reconstructor_.deform_stage().smooth(now.views, neighbours(pulse), made.work.result.mesh);
  made.work.result.times.smoothing = recon::milliseconds_since(smoothing);
  return made;
}

const recon::FrameSetJob* TakeSurfaces::input_in_window(int64_t pulse) const {
  const auto found = window_.find(pulse);
  return found == window_.end() ? nullptr : &found->second.surface.work;
}

bool TakeSurfaces::has(int64_t pulse) const {
  return std::binary_search(pulses_.begin(), pulses_.end(), pulse);
}

/// Makes the carved hull of a pulse once.
void TakeSurfaces::make_hull(int64_t pulse) {
  if (!has(pulse) || window_.contains(pulse)) return;
  TakeSurface surface = read_(pulse);
  recon::FrameSetJob& work = surface.work;
  reconstructor_.make_hull(work);
  const MonotonicInstant observing = Monotonic::now();
  recon::PulseViews views =
      reconstructor_.deform_stage().views(work.frames, work.volume, work.result.mesh);
  work.result.times.deform = recon::milliseconds_since(observing);
  window_.emplace(pulse, WindowEntry{std::move(surface), std::move(views)});
}

/// Deforms the surface of a pulse once. Requires the hulls of its neighbours.
void TakeSurfaces::deform(int64_t pulse) {
  const auto found = window_.find(pulse);
  if (found == window_.end() || found->second.deformed) return;
  auto& [surface, views, deformed] = found->second;
  recon::FrameSetJob& work = surface.work;
  const MonotonicInstant deforming = Monotonic::now();
  reconstructor_.deform_stage().deform(views, neighbours(pulse), work.volume, work.result.mesh);
  work.result.times.deform += recon::milliseconds_since(deforming);
  deformed = true;
}

/// Views of the pulses before and after, as far as the take has them.
std::vector<const recon::PulseViews*> TakeSurfaces::neighbours(int64_t pulse) const {
  std::vector<const recon::PulseViews*> neighbours;
  for (const int64_t p : {pulse - 1, pulse + 1}) {
    if (const auto found = window_.find(p); found != window_.end()) {
      neighbours.push_back(&found->second.views);
    }
  }
  return neighbours;
}

}  // namespace v3d::ctl
