// Unwraps the frame numbers of a camera to 64 bits.
#pragma once

#include <cstdint>

namespace v3d {

/// GigE Vision 1 numbers blocks with 16 bits and skips 0: 1 follows 65535. GigE Vision 2 and USB3
/// Vision number with 64 bits. A number above 65535 shows that the camera uses 64 bits. Unwrapped
/// numbers are one period (65535) larger than the camera's, so that an earlier frame has a number.
///
/// Requires that fewer than half a period (32767 frames) are lost in a row, and that frames are out
/// of order by at most as many. Not thread-safe.
class FrameCounter {
 public:
  uint64_t unwrap(uint64_t number) {
    if (number > kPeriod) is_64_bit_ = true;
    if (is_64_bit_) return kPeriod + number;
    if (started_) {
      last_ += shortest_step(number);
    } else {
      last_ = kPeriod + number;  // one period ahead: a frame before this one gets a number, too
    }
    started_ = true;
    return last_;
  }

 private:
  static constexpr int64_t kPeriod = 65535;  ///< 16-bit numbers run from 1 to 65535

  /// Smallest signed difference from the last number to this one, modulo kPeriod.
  int64_t shortest_step(uint64_t number) const {
    const int64_t step = static_cast<int64_t>(number) - static_cast<int64_t>(last_ % kPeriod);
    const int64_t half = kPeriod / 2;
    return (step + half + kPeriod) % kPeriod - half;
  }

  uint64_t last_ = 0;
  bool started_ = false;
  bool is_64_bit_ = false;
};

}  // namespace v3d
