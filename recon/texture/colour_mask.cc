#include "recon/texture/colour_mask.h"

#include <algorithm>

namespace v3d {
namespace {

constexpr int kReach = 2;  ///< pixels: as far as a Bayer sample reaches

/// A row of a mask; pixels beyond its ends have the value of the first or last pixel.
class EndlessRow {
 public:
  EndlessRow(const Mask& mask, int y)
      : words_(mask.row(std::clamp(y, 0, mask.size().height - 1))), width_(mask.size().width) {}

  /// Pixels x to x + 31; the first is the lowest bit.
  uint32_t bits(int x) const {
    if (x < 0 || x + 31 >= width_) {
      return bits_at_border(x);
    }
    const uint64_t low = words_[x / 64] >> (x % 64);
    const bool straddles = x % 64 > 32;
    return static_cast<uint32_t>(straddles ? low | words_[x / 64 + 1] << (64 - x % 64) : low);
  }

 private:
  uint32_t bits_at_border(int x) const {
    uint32_t bits = 0;
    for (int i = 0; i < 32; ++i) {
      const int at = std::clamp(x + i, 0, width_ - 1);
      bits |= static_cast<uint32_t>(words_[at / 64] >> (at % 64) & 1) << i;
    }
    return bits;
  }

  std::span<const uint64_t> words_;
  int width_;
};

}  // namespace

ColourMask::ColourMask(const Frame& frame)
    : roi_(frame.roi),
      words_per_row_((frame.roi.width + 31) / 32 * 2),
      words_(static_cast<size_t>(words_per_row_) * frame.roi.height, ~uint32_t{0}) {
  if (!frame.mask) {
    return;
  }
  uint32_t* out = words_.data();
  for (int y = roi_.y0; y < roi_.y0 + roi_.height; ++y) {
    const EndlessRow above(*frame.mask, y - kReach), row(*frame.mask, y);
    const EndlessRow below(*frame.mask, y + kReach);
    for (int x = roi_.x0; x < roi_.x0 + roi_.width; x += 32) {
      const uint32_t foreground = row.bits(x);
      const uint32_t inner =
          foreground & above.bits(x) & below.bits(x) & row.bits(x - kReach) & row.bits(x + kReach);
      *out++ = (foreground & 0xFFFF) | inner << 16;
      *out++ = foreground >> 16 | (inner & 0xFFFF0000);
    }
  }
}

}  // namespace v3d
