#include "base/image/colour.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "base/core/error.h"

namespace v3d {

bool ColourResponse::is_identity() const { return black.isZero(0) && matrix.isIdentity(0); }

Eigen::Vector3d ColourResponse::corrected(const Eigen::Vector3d& grey) const {
  return matrix * (grey - black);
}

ColourResponse ColourResponse::inverse() const { return {-(matrix * black), matrix.inverse()}; }

bool operator==(const ColourResponse& a, const ColourResponse& b) {
  return a.black == b.black && a.matrix == b.matrix;
}

void correct(Image& image, const ColourResponse& response) {
  V3D_CHECK(image.format == PixelFormat::kRGB8);
  if (response.is_identity()) return;
  for (size_t i = 0; i + 2 < image.bytes.size(); i += 3) {
    uint8_t* const pixel = &image.bytes[i];
    const Eigen::Vector3d colour =
        response.corrected(Eigen::Vector3d(pixel[0], pixel[1], pixel[2]));
    for (int k = 0; k < 3; ++k) {
      pixel[k] = static_cast<uint8_t>(std::lround(std::clamp(colour[k], 0.0, 255.0)));
    }
  }
}

namespace {

/// Half of the side of a filter, in pixels.
constexpr int kFilterRadius = 2;

/// Index i reflected into [0, count) about the first and the last pixel (... 2 1 0 1 2 ...), so
/// that a mosaic keeps its pattern.
int mirrored(int i, int count) {
  if (count == 1) return 0;
  const int period = 2 * (count - 1);
  i = (i % period + period) % period;
  return std::min(i, period - i);
}

/// A row with kFilterRadius mirrored pixels before and after it.
using PaddedRow = std::vector<int16_t>;

void load_padded_row(ImageView source, int y, PaddedRow& padded) {
  const int width = source.size.width;
  const uint8_t* row = source.row(mirrored(y, source.size.height));
  std::copy_n(row, width, padded.begin() + kFilterRadius);
  for (int i = 1; i <= kFilterRadius; ++i) {
    padded[kFilterRadius - i] = row[mirrored(-i, width)];
    padded[kFilterRadius + width - 1 + i] = row[mirrored(width - 1 + i, width)];
  }
}

uint8_t from_sixteenths(int value) {
  return static_cast<uint8_t>(std::clamp((value + 8) >> 4, 0, 255));
}

/// Results of all filters for each pixel of a row. The mosaic position of a pixel selects two of
/// them; computing all of them lets the compiler use full SIMD registers.
struct Estimates {
  explicit Estimates(size_t width)
      : green(width), opposite(width), row_colour(width), column_colour(width) {}
  std::vector<uint8_t> green;          ///< at a red or blue pixel
  std::vector<uint8_t> opposite;       ///< blue at a red pixel, red at a blue one
  std::vector<uint8_t> row_colour;     ///< at a green pixel, the other colour of its row
  std::vector<uint8_t> column_colour;  ///< at a green pixel, the colour of the rows above and below
};

/// `rows`: the five rows centred on the current one.
void estimate(const std::array<const int16_t*, 5>& rows, Estimates& to) {
  const auto& [top, above, row, below, bottom] = rows;
  const int width = static_cast<int>(to.green.size());
  for (int i = 0; i < width; ++i) {
    const int x = i + kFilterRadius;
    const int own = row[x];
    const int horizontal = row[x - 1] + row[x + 1], vertical = above[x] + below[x];
    const int far_horizontal = row[x - 2] + row[x + 2], far_vertical = top[x] + bottom[x];
    const int corners = above[x - 1] + above[x + 1] + below[x - 1] + below[x + 1];
    to.green[i] = from_sixteenths(8 * own + 4 * (horizontal + vertical) -
                                  2 * (far_horizontal + far_vertical));
    to.opposite[i] = from_sixteenths(12 * own + 4 * corners - 3 * (far_horizontal + far_vertical));
    to.row_colour[i] =
        from_sixteenths(10 * own + 8 * horizontal - 2 * (far_horizontal + corners) + far_vertical);
    to.column_colour[i] =
        from_sixteenths(10 * own + 8 * vertical - 2 * (far_vertical + corners) + far_horizontal);
  }
}

void demosaic(ImageView source, Image& rgb) {
  const int width = source.size.width;
  std::array<PaddedRow, 5> window;
  for (PaddedRow& row : window) row.resize(static_cast<size_t>(width) + 2 * kFilterRadius);
  for (int i = 0; i < 4; ++i) load_padded_row(source, i - kFilterRadius, window[i]);
  Estimates estimates(width);
  for (int y = 0; y < source.size.height; ++y) {
    load_padded_row(source, y + kFilterRadius, window[(y + 4) % 5]);
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
          pixel[in_row] = estimates.row_colour[x];
          pixel[2 - in_row] = estimates.column_colour[x];
        } else {
          pixel[1] = estimates.green[x];
          pixel[2 - own] = estimates.opposite[x];
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
