// Number of frames that a camera exposed, derived from its frame counter.
#pragma once

#include <algorithm>
#include <cstdint>

namespace v3d {

/// Counts exposed frames, including frames that were lost on the way to the host.
///
/// A lost frame leaves a gap in the camera's counter; a restart of the camera resets the counter.
/// The count is the number of counter values from the first to the last received frame, summed over
/// all runs of the camera. Frames may arrive out of order by up to 4 counter values; a gap of
/// 100,000 or more counts as a restart.
class ExposureCount {
 public:
  /// Adds the next received frame. `counter`: its frame counter.
  void add(uint64_t counter) {
    const bool continues =
        frames_ > 0 && counter + kOutOfOrder >= last_ && counter < last_ + kMaxLost;
    if (!continues) {
      earlier_runs_ += span();
      first_ = last_ = counter;
      frames_ = 0;
    }
    first_ = std::min(first_, counter);
    last_ = std::max(last_, counter);
    ++frames_;
  }
  int64_t exposed() const { return earlier_runs_ + span(); }

 private:
  static constexpr uint64_t kOutOfOrder = 4;
  static constexpr uint64_t kMaxLost = 100'000;

  int64_t span() const { return frames_ == 0 ? 0 : static_cast<int64_t>(last_ - first_) + 1; }

  int64_t earlier_runs_ = 0;
  int64_t frames_ = 0;
  uint64_t first_ = 0, last_ = 0;
};

}  // namespace v3d
