// Frame numbers as cameras send them, to 64 bit.
#pragma once

#include <cstdint>

namespace v3d {

/// GigE Vision 1 numbers blocks with 16 bits and skips 0: after 65535 comes 1. GigE Vision 2 and
/// USB3 Vision number with 64 bits. Which one a camera uses shows in the numbers: one beyond 65535
/// can only be 64 bits wide. Unwrapped 16-bit numbers start one round up. Requires that less than
/// half a round (32767 frames) is lost in a row, and that frames are at most as much out of order.
class FrameCounter {
 public:
  uint64_t unwrap(uint64_t number) {
    if (number > kRound) wide_ = true;
    if (wide_) return kRound + number;
    if (begun_) {
      last_ += shortest_step(number);
    } else {
      last_ = kRound + number;  // a round ahead, so that a frame from before it has a number too
    }
    begun_ = true;
    return last_;
  }

 private:
  static constexpr int64_t kRound = 65535;  ///< numbers in one round: 1 to 65535

  /// From the last frame to this one, modulo a round.
  int64_t shortest_step(uint64_t number) const {
    const int64_t step = static_cast<int64_t>(number) - static_cast<int64_t>(last_ % kRound);
    const int64_t half = kRound / 2;
    return (step + half + kRound) % kRound - half;
  }

  uint64_t last_ = 0;
  bool begun_ = false;
  bool wide_ = false;
};

}  // namespace v3d
