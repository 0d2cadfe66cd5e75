#include "v3dctl/reconstruct/take_surfaces.h"

#include <algorithm>
#include <utility>

#include "base/core/time.h"

namespace v3d::ctl {

TakeSurfaces::TakeSurfaces(TakeFrames& take, Reconstructor& reconstructor,
                           TakeSilhouetteRepair* repair, bool smooth)
    : take_(take),
      reconstructor_(reconstructor),
      repair_(repair),
      smooth_(smooth),
      pulses_(take.pulses()) {}

TakeSurface TakeSurfaces::make(int64_t pulse) {
  if (!smooth_) {
    TakeSurface made = read(pulse);
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
  made.work.result.times.smoothing = milliseconds_since(smoothing);
  return made;
}

TakeSurface TakeSurfaces::read(int64_t pulse) {
  const MonotonicInstant begin = Monotonic::now();
  TakeSurface made;
  if (repair_ != nullptr) set_previous_of(pulse);
  made.frames = pulse == next_pulse_ ? std::move(next_) : take_.read(pulse);
  if (repair_ != nullptr) repair(pulse, made.frames);
  made.work = FrameSetJob(observe_all(pulse, made.frames));
  made.work.set.exposure = take_.edge_of(pulse);
  made.segment_ms = milliseconds_since(begin);
  return made;
}

/// Reads the pulse before, where a shard begins.
void TakeSurfaces::set_previous_of(int64_t pulse) {
  if (!has(pulse - 1) || repair_->is_previous(pulse - 1)) return;
  repair_->set_previous(pulse - 1, take_.read(pulse - 1));
}

void TakeSurfaces::repair(int64_t pulse, SegmentedFrames& frames) {
  next_pulse_ = pulse + 1;
  next_ = take_.read(next_pulse_);
  repair_->repair(pulse, frames, next_);
}

bool TakeSurfaces::has(int64_t pulse) const {
  return std::binary_search(pulses_.begin(), pulses_.end(), pulse);
}

/// Makes the carved hull of a pulse once.
void TakeSurfaces::make_hull(int64_t pulse) {
  if (!has(pulse) || window_.contains(pulse)) return;
  TakeSurface surface = read(pulse);
  FrameSetJob& work = surface.work;
  reconstructor_.make_hull(work);
  const MonotonicInstant observing = Monotonic::now();
  PulseViews views =
      reconstructor_.deform_stage().views(work.frames, work.volume, work.result.mesh);
  work.result.times.deform = milliseconds_since(observing);
  window_.emplace(pulse, WindowEntry{std::move(surface), std::move(views)});
}

/// Deforms the surface of a pulse once. Requires the hulls of its neighbours.
void TakeSurfaces::deform(int64_t pulse) {
  const auto found = window_.find(pulse);
  if (found == window_.end() || found->second.deformed) return;
  auto& [surface, views, deformed] = found->second;
  FrameSetJob& work = surface.work;
  const MonotonicInstant deforming = Monotonic::now();
  reconstructor_.deform_stage().deform(views, neighbours(pulse), work.volume, work.result.mesh);
  work.result.times.deform += milliseconds_since(deforming);
  deformed = true;
}

/// Views of the pulses before and after, as far as the take has them.
std::vector<const PulseViews*> TakeSurfaces::neighbours(int64_t pulse) const {
  std::vector<const PulseViews*> neighbours;
  for (const int64_t p : {pulse - 1, pulse + 1}) {
    if (const auto found = window_.find(p); found != window_.end()) {
      neighbours.push_back(&found->second.views);
    }
  }
  return neighbours;
}

}  // namespace v3d::ctl
