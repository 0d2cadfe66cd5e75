// Colour mask: which pixels of a frame are foreground, and where an interpolated colour may contain
// background.
#pragma once

#include <cstdint>
#include <vector>

#include "base/image/frame.h"

namespace v3d::recon {

/// Two bits for every pixel of the roi of a frame. Row y - roi.y0 has words_per_row() words of 16
/// pixels each; pixel x is in word (x - roi.x0) / 16. Bit (x - roi.x0) % 16 is set for foreground.
/// The bit 16 above is set when the four pixels two steps left, right, above and below are
/// foreground as well (at the border, the border pixel counts), so that a sample contains
/// foreground only. Without a mask all bits are 1.
///
/// Immutable; any thread.
class ColourMask {
 public:
  ColourMask() = default;
  explicit ColourMask(const Frame& frame);

  int words_per_row() const { return words_per_row_; }
  const uint32_t* words() const { return words_.data(); }

  /// (x, y) in the whole image. Requires that the roi contains it.
  bool foreground(int x, int y) const { return bit(x, y, 0); }
  bool inner(int x, int y) const { return bit(x, y, 16); }

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
