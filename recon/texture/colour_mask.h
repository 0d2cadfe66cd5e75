// Colour mask: how far the pixels of a frame are inside its silhouette, and so how surely a colour
// there is the performer's.
#pragma once

#include <cstdint>
#include <vector>

#include "base/image/frame.h"

namespace v3d::recon {

/// Place of a pixel in its silhouette.
enum class PixelDepth : uint8_t {
  kOutside = 0,  ///< background
  kRim = 1,      ///< an interpolated colour here reads background pixels
  kInner = 2,    ///< it reads foreground only, but a loose silhouette has room there
  kDeep = 3      ///< farther inside than silhouettes are loose
};

/// The PixelDepth of every pixel of the roi of a frame, in two bits. Row y - roi.y0 has
/// words_per_row() words of 16 pixels each; pixel x is in word (x - roi.x0) / 16. Its low bit is
/// bit (x - roi.x0) % 16, its high bit the one 16 above.
///
/// A pixel is kInner when the four pixels two steps left, right, above and below are foreground as
/// well, and kDeep when those five steps away and four steps diagonally are, too. At the border,
/// the border pixel counts. Without a mask all pixels are kDeep.
///
/// Immutable; any thread.
class ColourMask {
 public:
  ColourMask() = default;
  explicit ColourMask(const Frame& frame);

  int words_per_row() const { return words_per_row_; }
  const uint32_t* words() const { return words_.data(); }

  /// (x, y) in the whole image. Requires that the roi contains it.
  PixelDepth depth(int x, int y) const {
    const int column = x - roi_.x0;
    const size_t word = static_cast<size_t>(y - roi_.y0) * words_per_row_ + column / 16;
    const uint32_t bits = words_[word] >> column % 16;
    return static_cast<PixelDepth>((bits & 1) | (bits >> 15 & 2));
  }
  bool foreground(int x, int y) const { return depth(x, y) != PixelDepth::kOutside; }
  bool inner(int x, int y) const { return depth(x, y) >= PixelDepth::kInner; }

 private:
  Rect roi_;
  int words_per_row_ = 0;
  std::vector<uint32_t> words_;
};

}  // namespace v3d::recon
