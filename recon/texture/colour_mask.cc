#include "recon/texture/colour_mask.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/image/mask_operations.h"
#include "recon/texture/texture.h"

namespace v3d::recon {
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
  Mask differing, within;
  const Mask *sure = &*frame.mask, *foreground = &*frame.mask;
  if (frame.background_difference) {
    differing = intersection_of(*frame.mask, *frame.background_difference);
    within = union_of(differing, erode(*frame.mask, kLooseReach));
    sure = &differing, foreground = &within;
  }
  uint32_t* out = words_.data();
  for (int y = roi_.y0; y < roi_.y0 + roi_.height; ++y) {
    const EndlessRow mask(*frame.mask, y), kept(*foreground, y), row(*sure, y);
    const EndlessRow above(*sure, y - kReach), below(*sure, y + kReach);
    for (int x = roi_.x0; x < roi_.x0 + roi_.width; x += 32) {
      const uint32_t inner =
          row.bits(x) & above.bits(x) & below.bits(x) & row.bits(x - kReach) & row.bits(x + kReach);
      const uint32_t low = kept.bits(x), background_like = mask.bits(x) & ~low;
      const uint32_t high = inner | background_like;
      *out++ = (low & 0xFFFF) | high << 16;
      *out++ = low >> 16 | (high & 0xFFFF0000);
    }
  }
}

// Interpolation of colours at sub-pixel positions of raw images.

namespace {

/// Index mirrored about the first and the last pixel. Mirroring preserves the parity, so a sample
/// beyond the border of a Bayer image has the correct colour.
int mirror(int i, int count) {
  if (i >= 0 && i < count) {
    return i;
  }
  const int last = count - 1;
  i = last > 0 ? std::abs(i) % (2 * last) : 0;
  return std::min(i, 2 * last - i);
}

struct Cell {
  int index;       ///< of the lattice point at or before the position
  float fraction;  ///< on the way to the next, 0 to 1
};

Cell cell_of(float position) {
  const float lower = std::floor(position);
  return {static_cast<int>(lower), position - lower};
}

/// `value(i, j)`: the sample at lattice point (i, j).
template <class Value>
float bilinear(Cell a, Cell b, Value&& value) {
  const float low =
      value(a.index, b.index) * (1 - a.fraction) + value(a.index + 1, b.index) * a.fraction;
  const float high =
      value(a.index, b.index + 1) * (1 - a.fraction) + value(a.index + 1, b.index + 1) * a.fraction;
  return low * (1 - b.fraction) + high * b.fraction;
}

/// `step`: channels per pixel.
float pixel_at(const ImageView& image, int x, int y, int step = 1, int channel = 0) {
  const int column = mirror(x, image.size.width), row = mirror(y, image.size.height);
  return image.bytes[(static_cast<size_t>(row) * image.size.width + column) * step + channel];
}

/// simd_sample_colour.inc does the same for many points at once: change both together.
Eigen::Vector3f sample_bayer(const ImageView& image, float u, float v) {
  // The pattern repeats every 2 x 2 pixels. Find the red pixel; the blue one is diagonally
  // opposite.
  int red = 0;
  while (bayer_channel(image.format, red % 2, red / 2) != 0) {
    ++red;
  }
  const auto square = [&](int x0, int y0) {
    return bilinear(cell_of((u - static_cast<float>(x0)) / 2),
                    cell_of((v - static_cast<float>(y0)) / 2),
                    [&](int i, int j) { return pixel_at(image, 2 * i + x0, 2 * j + y0); });
  };
  // Green pixels are where x + y has parity g. With a = (x + y - g) / 2 and b = (x - y - g) / 2
  // every pair of integers (a, b) is one green pixel.
  const int g = bayer_channel(image.format, 0, 0) == 1 ? 0 : 1;
  const auto parity = static_cast<float>(g);
  const float green = bilinear(cell_of((u + v - parity) / 2), cell_of((u - v - parity) / 2),
                               [&](int a, int b) { return pixel_at(image, a + b + g, a - b); });
  const int rx = red % 2, ry = red / 2;
  return {square(rx, ry), green, square(1 - rx, 1 - ry)};
}

}  // namespace

std::optional<Eigen::Vector3f> sample_colour(ImageView image, double u, double v) {
  const bool inside =
      u >= -0.5 && v >= -0.5 && u < image.size.width - 0.5 && v < image.size.height - 0.5;
  const int min_side = is_bayer(image.format) ? 2 : 1;
  if (!inside || image.size.width < min_side || image.size.height < min_side) {
    return std::nullopt;
  }
  const auto x = static_cast<float>(u), y = static_cast<float>(v);
  if (is_bayer(image.format)) {
    return sample_bayer(image, x, y);
  }
  const int step = bytes_per_pixel(image.format);
  const auto channel = [&](int k) {
    return bilinear(cell_of(x), cell_of(y),
                    [&](int i, int j) { return pixel_at(image, i, j, step, k); });
  };
  if (image.format == PixelFormat::kRGB8) {
    return Eigen::Vector3f(channel(0), channel(1), channel(2));
  }
  return Eigen::Vector3f::Constant(channel(0));
}

}  // namespace v3d::recon
