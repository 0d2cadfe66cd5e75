// How many frames a camera exposed, by its own frame counter.
#pragma once

#include <algorithm>
#include <cstdint>

namespace v3d {

/// The counter goes on where a frame is lost on its way, and begins anew where the camera did:
/// frames exposed are the numbers between the first and the last frame that arrived, added up over
/// the times that the camera began.
class ExposureCount {
 public:
  /// The counter of the next frame.
  void add(uint64_t counter) {
    const bool goes_on =
        frames_ > 0 && counter + kOutOfOrder >= last_ && counter < last_ + kMaxLost;
    if (!goes_on) {
      before_ += span();
      first_ = last_ = counter;
      frames_ = 0;
    }
    first_ = std::min(first_, counter);
    last_ = std::max(last_, counter);
    ++frames_;
  }
  int64_t exposed() const { return before_ + span(); }

 private:
  static constexpr uint64_t kOutOfOrder = 4;
  static constexpr uint64_t kMaxLost = 100'000;

  int64_t span() const { return frames_ == 0 ? 0 : static_cast<int64_t>(last_ - first_) + 1; }

  int64_t before_ = 0;
  int64_t frames_ = 0;
  uint64_t first_ = 0, last_ = 0;
};

}  // namespace v3d
