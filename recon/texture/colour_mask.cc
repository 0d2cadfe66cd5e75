#include "recon/texture/colour_mask.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>

#include "recon/texture/texture.h"

namespace v3d::recon {
namespace {

constexpr int kSampleReach = 2;  ///< pixels: as far as a Bayer sample reaches
/// Pixels that silhouettes are loose, and the reach of a sample (v3d-room-colours: 3 and 2).
constexpr int kLooseReach = 5;
constexpr int kLooseDiagonal = 4;  ///< the same along a diagonal, in pixels of each axis

/// A row of a mask; pixels beyond its ends have the value of the first or last pixel.
class EndlessRow {
 public:
  static constexpr int kMargin = 8;  ///< pixels before those asked for
  static_assert(kLooseReach <= kMargin);

  EndlessRow(const Mask& mask, int y)
      : words_(mask.row(std::clamp(y, 0, mask.size().height - 1))), width_(mask.size().width) {}

  /// Pixels x - kMargin to x + 31 + kMargin; the first is the lowest bit.
  uint64_t bits(int x) const {
    static_assert(std::endian::native == std::endian::little);
    const int begin = x - kMargin;
    if (begin < 0 || begin + 63 >= width_) return bits_at_border(begin);
    uint64_t bits = 0;
    const auto* bytes = reinterpret_cast<const uint8_t*>(words_.data());
    std::memcpy(&bits, bytes + begin / 8, sizeof bits);
    return bits >> begin % 8;
  }

 private:
  uint64_t bits_at_border(int begin) const {
    uint64_t bits = 0;
    for (int i = 0; i < 32 + 2 * kMargin; ++i) {
      const int at = std::clamp(begin + i, 0, width_ - 1);
      bits |= (words_[at / 64] >> (at % 64) & 1) << i;
    }
    return bits;
  }

  std::span<const uint64_t> words_;
  int width_;
};

/// A row of a mask and the rows around it that decide about its pixels.
class RowNeighbourhood {
 public:
  RowNeighbourhood(const Mask& mask, int y)
      : row_(mask, y),
        sample_{{mask, y - kSampleReach}, {mask, y + kSampleReach}},
        loose_{{mask, y - kLooseReach}, {mask, y + kLooseReach}},
        diagonal_{{mask, y - kLooseDiagonal}, {mask, y + kLooseDiagonal}} {}

  /// Pixels x to x + 31, bits of one class each.
  struct Classes {
    uint32_t foreground, inner, deep;
  };
  Classes at(int x) const {
    const uint64_t row = row_.bits(x);
    const uint32_t foreground = moved(row, 0);
    const uint32_t inner = foreground & both_sides(row, kSampleReach) &
                           moved(sample_[0].bits(x) & sample_[1].bits(x), 0);
    const uint32_t deep = inner & both_sides(row, kLooseReach) &
                          moved(loose_[0].bits(x) & loose_[1].bits(x), 0) &
                          both_sides(diagonal_[0].bits(x) & diagonal_[1].bits(x), kLooseDiagonal);
    return {foreground, inner, deep};
  }

 private:
  static uint32_t moved(uint64_t bits, int by) {
    return static_cast<uint32_t>(bits >> (EndlessRow::kMargin + by));
  }
  static uint32_t both_sides(uint64_t bits, int by) { return moved(bits, by) & moved(bits, -by); }

  EndlessRow row_, sample_[2], loose_[2], diagonal_[2];
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
    const RowNeighbourhood rows(*frame.mask, y);
    for (int x = roi_.x0; x < roi_.x0 + roi_.width; x += 32) {
      const auto [foreground, inner, deep] = rows.at(x);
      const uint32_t low = deep | (foreground & ~inner), high = inner;
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
