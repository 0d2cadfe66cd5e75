#include "base/image/picture.h"

#include <algorithm>
#include <cmath>

#include "base/core/error.h"
#include "base/image/jpeg.h"
#include "base/image/png_file.h"
#include "base/io/whole_file.h"

namespace v3d {

Image read_picture(const std::filesystem::path& path) {
  return decode_picture(read_file(path), path);
}

Image decode_picture(std::string_view bytes, const std::filesystem::path& path) {
  if (bytes.starts_with("\x89PNG")) return decode_rgb_png(bytes, path);
  const std::span<const uint8_t> jpeg{reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()};
  if (const auto size = jpeg_size(jpeg)) {
    if (auto image = decode_jpeg(jpeg, *size)) return std::move(*image);
  }
  throw InputError(path.string() + ": not a valid PNG or JPEG picture");
}

Mask mask_from_picture(const Image& picture) {
  Mask mask(picture.size);
  for (int y = 0; y < picture.size.height; ++y) {
    const uint8_t* rgb = picture.row(y);
    for (int x = 0; x < picture.size.width; ++x, rgb += 3) {
      if (rgb[0] + rgb[1] + rgb[2] >= 3 * 128) mask.set(x, y);
    }
  }
  return mask;
}

Image fill_size(const Image& picture, ImageSize size) {
  Image filled(size, PixelFormat::kRGB8);
  const double scale = std::max(static_cast<double>(size.width) / picture.size.width,
                                static_cast<double>(size.height) / picture.size.height);
  const auto source = [&](int n, int to, int from) {
    const double at = (n + 0.5 - 0.5 * to) / scale + 0.5 * from - 0.5;
    return std::clamp(at, 0.0, from - 1.0);
  };
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      sample_picture(picture, source(x, size.width, picture.size.width),
                     source(y, size.height, picture.size.height), filled.row(y) + 3 * x);
    }
  }
  return filled;
}

void sample_picture(const Image& picture, double x, double y, uint8_t rgb[3]) {
  const auto [width, height] = picture.size;
  const double left = std::floor(x), above = std::floor(y);
  const double s = x - left, t = y - above;
  const auto column = [w = width](double at) {
    const int n = static_cast<int>(std::fmod(at, w));
    return 3 * (n < 0 ? n + w : n);
  };
  const auto row = [&, h = height](double at) {
    return picture.row(static_cast<int>(std::clamp(at, 0.0, h - 1.0)));
  };
  const uint8_t* upper = row(above);
  const uint8_t* lower = row(above + 1);
  const int i = column(left), j = column(left + 1);
  for (int c = 0; c < 3; ++c) {
    const double high = (1 - s) * upper[i + c] + s * upper[j + c];
    const double low = (1 - s) * lower[i + c] + s * lower[j + c];
    rgb[c] = static_cast<uint8_t>((1 - t) * high + t * low + 0.5);
  }
}

}  // namespace v3d
