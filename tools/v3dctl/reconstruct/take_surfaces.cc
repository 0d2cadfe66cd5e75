#include "v3dctl/reconstruct/take_surfaces.h"

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
  if (!steady_) {
    TakeSurface made = read(pulse);
    reconstructor_.make_surface(made.work);
    return made;
  }
  constexpr int kReach = 2;
  std::erase_if(window_, [&](const auto& entry) {
    return entry.first < pulse - kReach || entry.first > pulse + kReach;
  });
  for (int64_t p = pulse - kReach; p <= pulse + kReach; ++p) look_at(p);
  for (int64_t p = pulse - 1; p <= pulse + 1; ++p) deform(p);
  Raw& now = window_.at(pulse);
  TakeSurface made = std::move(now.surface);
  reconstructor_.steady(made.work, now.moment, beside(pulse));
  return made;
}

TakeSurface TakeSurfaces::read(int64_t pulse) {
  const MonotonicInstant begin = Monotonic::now();
  TakeSurface made;
  if (mending_ != nullptr) look_at_before(pulse);
  made.frames = pulse == ahead_pulse_ ? std::move(ahead_) : take_.read(pulse);
  if (mending_ != nullptr) mend(pulse, made.frames);
  made.work = SetAtWork(observe_all(pulse, made.frames));
  made.work.set.exposure = take_.edge_of(pulse);
  made.segment_ms = 1000 * to_seconds(Monotonic::now() - begin);
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

/// The hull and its hollows, once.
void TakeSurfaces::look_at(int64_t pulse) {
  if (!has(pulse) || window_.contains(pulse)) return;
  TakeSurface surface = read(pulse);
  reconstructor_.make_hull(surface.work);
  Moment moment = reconstructor_.look(surface.work);
  window_.emplace(pulse, Raw{std::move(surface), std::move(moment)});
}

/// The surface, once. Requires that the pulses beside it were looked at.
void TakeSurfaces::deform(int64_t pulse) {
  const auto found = window_.find(pulse);
  if (found == window_.end() || found->second.deformed) return;
  auto& [surface, moment, deformed] = found->second;
  reconstructor_.make_surface(surface.work, moment, beside(pulse));
  deformed = true;
}

/// Of the pulses before and after, as far as the take has them.
std::vector<const Moment*> TakeSurfaces::beside(int64_t pulse) const {
  std::vector<const Moment*> beside;
  for (const int64_t p : {pulse - 1, pulse + 1}) {
    if (const auto found = window_.find(p); found != window_.end()) {
      beside.push_back(&found->second.moment);
    }
  }
  return beside;
}

}  // namespace v3d::ctl
