#include "base/image/demosaic.h"

#include <algorithm>
#include <array>
#include <vector>

#include "base/core/check.h"

namespace v3d {
namespace {

/// Half of the filters' side.
constexpr int kReach = 2;

/// ... 2 1 0 1 2 ...: about the first and the last pixel, so that a mosaic keeps its pattern.
int mirrored(int i, int count) {
  if (count == 1) return 0;
  const int period = 2 * (count - 1);
  i = (i % period + period) % period;
  return std::min(i, period - i);
}

/// A row with kReach mirrored pixels before and behind it.
using WideRow = std::vector<int16_t>;

void widen(ImageView source, int y, WideRow& wide) {
  const int width = source.size.width;
  const uint8_t* row = source.row(mirrored(y, source.size.height));
  std::copy_n(row, width, wide.begin() + kReach);
  for (int i = 1; i <= kReach; ++i) {
    wide[kReach - i] = row[mirrored(-i, width)];
    wide[kReach + width - 1 + i] = row[mirrored(width - 1 + i, width)];
  }
}

uint8_t from_sixteenths(int value) {
  return static_cast<uint8_t>(std::clamp((value + 8) >> 4, 0, 255));
}

/// What the filters say of a row: for every pixel as if it were any of the mosaic's. Of these the
/// pixel's own place takes two, and computing all lets the compiler use whole registers.
struct Estimates {
  explicit Estimates(size_t width) : green(width), across(width), along(width), beside(width) {}
  std::vector<uint8_t> green;   ///< at a red or blue pixel
  std::vector<uint8_t> across;  ///< blue at a red pixel, red at a blue one
  std::vector<uint8_t> along;   ///< at a green pixel, the colour of its row
  std::vector<uint8_t> beside;  ///< and that of the rows above and below
};

/// `rows`: the five rows round the one in question.
void estimate(const std::array<const int16_t*, 5>& rows, Estimates& to) {
  const auto& [top, above, row, below, bottom] = rows;
  const int width = static_cast<int>(to.green.size());
  for (int i = 0; i < width; ++i) {
    const int x = i + kReach;
    const int own = row[x];
    const int sides = row[x - 1] + row[x + 1], ends = above[x] + below[x];
    const int far_sides = row[x - 2] + row[x + 2], far_ends = top[x] + bottom[x];
    const int corners = above[x - 1] + above[x + 1] + below[x - 1] + below[x + 1];
    to.green[i] = from_sixteenths(8 * own + 4 * (sides + ends) - 2 * (far_sides + far_ends));
    to.across[i] = from_sixteenths(12 * own + 4 * corners - 3 * (far_sides + far_ends));
    to.along[i] = from_sixteenths(10 * own + 8 * sides - 2 * (far_sides + corners) + far_ends);
    to.beside[i] = from_sixteenths(10 * own + 8 * ends - 2 * (far_ends + corners) + far_sides);
  }
}

void demosaic(ImageView source, Image& rgb) {
  const int width = source.size.width;
  std::array<WideRow, 5> window;
  for (WideRow& row : window) row.resize(static_cast<size_t>(width) + 2 * kReach);
  for (int i = 0; i < 4; ++i) widen(source, i - kReach, window[i]);
  Estimates estimates(width);
  for (int y = 0; y < source.size.height; ++y) {
    widen(source, y + kReach, window[(y + 4) % 5]);
    std::array<const int16_t*, 5> rows;
    for (int i = 0; i < 5; ++i) rows[i] = window[(y + i) % 5].data();
    estimate(rows, estimates);
    const uint8_t* measured = source.row(y);
    uint8_t* out = rgb.row(y);
    for (int first = 0; first < 2; ++first) {  // every second pixel has the same filter
      const int own = bayer_channel(source.format, first, y);
      const int in_row = bayer_channel(source.format, first + 1, y);
      for (int x = first; x < width; x += 2) {
        uint8_t* pixel = out + size_t{3} * x;
        pixel[own] = measured[x];
        if (own == 1) {
          pixel[in_row] = estimates.along[x];
          pixel[2 - in_row] = estimates.beside[x];
        } else {
          pixel[1] = estimates.green[x];
          pixel[2 - own] = estimates.across[x];
        }
      }
    }
  }
}

}  // namespace

Image to_rgb(ImageView source) {
  Image rgb(source.size, PixelFormat::kRGB8);
  if (source.format == PixelFormat::kRGB8) {
    std::copy_n(source.bytes.begin(), rgb.bytes.size(), rgb.bytes.begin());
  } else if (!is_bayer(source.format)) {
    for (size_t i = 0; i < rgb.bytes.size(); ++i) rgb.bytes[i] = source.bytes[i / 3];
  } else if (source.size.pixels() > 0) {
    demosaic(source, rgb);
  }
  return rgb;
}

Image mosaic(ImageView rgb, PixelFormat format) {
  V3D_CHECK(rgb.format == PixelFormat::kRGB8 && is_bayer(format));
  Image raw(rgb.size, format);
  for (int y = 0; y < rgb.size.height; ++y) {
    const std::array channel = {bayer_channel(format, 0, y), bayer_channel(format, 1, y)};
    const uint8_t* from = rgb.row(y);
    uint8_t* to = raw.row(y);
    for (int x = 0; x < rgb.size.width; ++x) to[x] = from[3 * x + channel[x % 2]];
  }
  return raw;
}

}  // namespace v3d
