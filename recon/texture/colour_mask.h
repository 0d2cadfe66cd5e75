// Where a frame has colour for the surface, and where that colour may be the background's.
#pragma once

#include <cstdint>
#include <vector>

#include "base/frame.h"

namespace v3d {

/// Two bits for every pixel of a frame's roi. Row y - roi.y0 has words_per_row() words of 16 pixels
/// each; pixel x is in word (x - roi.x0) / 16. Bit (x - roi.x0) % 16: foreground. The bit 16 above
/// it: foreground, and so are the four pixels two steps left, right, above and below (or the border
/// pixel before them), so that a sample is made of foreground alone. Without a mask all bits are 1.
/// Immutable; safe to use from any thread.
class ColourMask {
 public:
  ColourMask() = default;
  explicit ColourMask(const Frame& frame);

  int words_per_row() const { return words_per_row_; }
  const uint32_t* words() const { return words_.data(); }

  /// (x, y) in the whole image. Requires that roi contains it.
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

}  // namespace v3d
