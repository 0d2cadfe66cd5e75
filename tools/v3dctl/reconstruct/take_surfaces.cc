#include "v3dctl/reconstruct/take_surfaces.h"

#include <algorithm>
#include <utility>

#include "base/core/time.h"

namespace v3d::ctl {
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
