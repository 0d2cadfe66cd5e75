#include "v3dctl/take_surfaces.h"

#include <algorithm>
#include <utility>

#include "base/time.h"

namespace v3d::ctl {

TakeSurfaces::TakeSurfaces(TakeFrames& take, Reconstructor& reconstructor, MaskMending* mending,
                           bool steady)
    : take_(take),
      reconstructor_(reconstructor),
      mending_(mending),
      steady_(steady),
      pulses_(take.pulses()) {}

TakeSurface TakeSurfaces::make(int64_t pulse) {
  if (!steady_) return surface_of(pulse);
  std::erase_if(window_, [&](const auto& entry) {
    return entry.first < pulse - 1 || entry.first > pulse + 1;
  });
  const Moment *before = moment_at(pulse - 1), *now = moment_at(pulse),
               *after = moment_at(pulse + 1);
  std::vector<const Moment*> beside;
  for (const Moment* moment : {before, after}) {
    if (moment != nullptr) beside.push_back(moment);
  }
  TakeSurface made = std::move(window_.at(pulse).surface);
  reconstructor_.steady(made.work, *now, beside);
  return made;
}

TakeSurface TakeSurfaces::surface_of(int64_t pulse) {
  const MonotonicInstant begin = Monotonic::now();
  TakeSurface made;
  if (mending_ != nullptr) look_at_before(pulse);
  made.frames = pulse == ahead_pulse_ ? std::move(ahead_) : take_.read(pulse);
  if (mending_ != nullptr) mend(pulse, made.frames);
  made.work = SetAtWork(observe_all(pulse, made.frames));
  made.work.set.exposure = take_.edge_of(pulse);
  made.segment_ms = 1000 * to_seconds(Monotonic::now() - begin);
  reconstructor_.make_surface(made.work);
  return made;
}

/// The pulse before, where a part of the take begins.
void TakeSurfaces::look_at_before(int64_t pulse) {
  if (!has(pulse - 1) || mending_->knows(pulse - 1)) return;
  mending_->look_at(pulse - 1, take_.read(pulse - 1));
}

void TakeSurfaces::mend(int64_t pulse, SegmentedFrames& frames) {
  ahead_pulse_ = pulse + 1;
  ahead_ = take_.read(ahead_pulse_);
  mending_->mend(pulse, frames, ahead_);
}

bool TakeSurfaces::has(int64_t pulse) const {
  return std::binary_search(pulses_.begin(), pulses_.end(), pulse);
}

/// Null for a pulse that the take does not have.
const Moment* TakeSurfaces::moment_at(int64_t pulse) {
  if (!has(pulse)) return nullptr;
  auto found = window_.find(pulse);
  if (found == window_.end()) {
    TakeSurface surface = surface_of(pulse);
    Moment moment = reconstructor_.moment_of(surface.work);
    found = window_.emplace(pulse, Raw{std::move(surface), std::move(moment)}).first;
  }
  return &found->second.moment;
}

}  // namespace v3d::ctl
