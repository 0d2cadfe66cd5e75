// Colour mask: which pixels of a frame are foreground, and where a colour may be the background's.
#pragma once

#include <cstdint>
#include <vector>

#include "base/image/frame.h"

namespace v3d::recon {

/// Classes of the pixels in the roi of a frame, two bits for each:
///   0  outside the mask
///   1  rim: foreground, but an interpolated colour may contain background
///   2  background-like: equal to the background, and in the mask at most kLooseReach pixels from
///      its outline
///   3  inner: this pixel and the four pixels two steps left, right, above and below are in the
///      mask and differ from the background (at the border, the border pixel counts)
///
/// A pixel equals the background where the frame's background difference is 0; without a difference
/// none does. Farther from the outline such a pixel is rim: the performer may wear the colour.
///
/// Row y - roi.y0 has words_per_row() words of 16 pixels each. Pixel x has bits i and i + 16 of
/// word (x - roi.x0) / 16, with i = (x - roi.x0) % 16. Without a mask all pixels are inner.
///
/// Immutable; any thread.
class ColourMask {
 public:
  /// Pixels by which a mask may be too large.
  static constexpr int kLooseReach = 8;

  ColourMask() = default;
  /// Requires that frame.mask and frame.background_difference have the size of the sensor.
  explicit ColourMask(const Frame& frame);

  int words_per_row() const { return words_per_row_; }
  const uint32_t* words() const { return words_.data(); }

  // (x, y) in the whole image. Requires that the roi contains it.
  bool foreground(int x, int y) const { return bit(x, y, 0); }
  bool inner(int x, int y) const { return bit(x, y, 0) && bit(x, y, 16); }
  bool background_like(int x, int y) const { return !bit(x, y, 0) && bit(x, y, 16); }

 private:
  bool bit(int x, int y, int shift) const {
    const int column = x - roi_.x0;
    const size_t word = static_cast<size_t>(y - roi_.y0) * words_per_row_ + column / 16;
    return words_[word] >> (column % 16 + shift) & 1;
  }

  Rect roi_;
  int words_per_row_ = 0;
  std::vector<uint32_t> words_;
};

}  // namespace v3d::recon
