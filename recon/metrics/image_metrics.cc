// Similarity of rendered images and photographs: PSNR and SSIM inside a mask.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "recon/metrics/evaluation.h"

namespace v3d {
namespace {

using Plane = std::vector<double>;

Plane luma(ImageView image) {
  Plane plane(static_cast<size_t>(image.size.pixels()));
  for (size_t i = 0; i < plane.size(); ++i) {  // ITU-R BT.601
    plane[i] = 0.299 * image.bytes[3 * i] + 0.587 * image.bytes[3 * i + 1] +
               0.114 * image.bytes[3 * i + 2];
  }
  return plane;
}

Plane product(const Plane& a, const Plane& b) {
  Plane result(a.size());
  std::transform(a.begin(), a.end(), b.begin(), result.begin(), std::multiplies<>());
  return result;
}

constexpr int kRadius = 5;

std::array<double, 2 * kRadius + 1> gaussian() {
  constexpr double kSigma = 1.5;
  std::array<double, 2 * kRadius + 1> window{};
  for (int i = -kRadius; i <= kRadius; ++i) {
    window[i + kRadius] = std::exp(-i * i / (2 * kSigma * kSigma));
  }
  return window;
}

/// One pass along rows (step 1) or columns (step = width): `count` samples from `first`.
void blur_line(const Plane& from, Plane& to, size_t first, size_t step, int count) {
  static const auto window = gaussian();
  for (int i = 0; i < count; ++i) {
    double sum = 0, weight = 0;
    for (int k = std::max(0, i - kRadius); k <= std::min(count - 1, i + kRadius); ++k) {
      sum += window[k - i + kRadius] * from[first + k * step];
      weight += window[k - i + kRadius];
    }
    to[first + i * step] = sum / weight;
  }
}

Plane blurred(const Plane& plane, ImageSize size) {
  Plane rows(plane.size()), both(plane.size());
  const auto width = static_cast<size_t>(size.width);
  for (int y = 0; y < size.height; ++y) {
    blur_line(plane, rows, y * width, 1, size.width);
  }
  for (size_t x = 0; x < width; ++x) {
    blur_line(rows, both, x, width, size.height);
  }
  return both;
}

template <class Visit>
void for_each_pixel(const Mask& where, Visit&& visit) {
  for (int y = 0; y < where.size().height; ++y) {
    for (int x = 0; x < where.size().width; ++x) {
      if (where.get(x, y)) {
        visit(static_cast<size_t>(y) * where.size().width + x);
      }
    }
  }
}

}  // namespace

double psnr_db(ImageView a, ImageView b, const Mask& where) {
  int64_t squares = 0, count = 0;
  for_each_pixel(where, [&](size_t i) {
    for (size_t k = 3 * i; k < 3 * i + 3; ++k) {
      const int difference = a.bytes[k] - b.bytes[k];
      squares += int64_t{difference} * difference;
      ++count;
    }
  });
  if (squares == 0) {
    return std::numeric_limits<double>::infinity();
  }
  return 10 * std::log10(255.0 * 255.0 * static_cast<double>(count) / static_cast<double>(squares));
}

double ssim(ImageView a, ImageView b, const Mask& where) {
  constexpr double kC1 = (0.01 * 255) * (0.01 * 255), kC2 = (0.03 * 255) * (0.03 * 255);
  const Plane x = luma(a), y = luma(b);
  const Plane mean_x = blurred(x, a.size), mean_y = blurred(y, a.size);
  const Plane xx = blurred(product(x, x), a.size), yy = blurred(product(y, y), a.size);
  const Plane xy = blurred(product(x, y), a.size);
  double sum = 0;
  int64_t count = 0;
  for_each_pixel(where, [&](size_t i) {
    const double mx = mean_x[i], my = mean_y[i];
    const double var_x = xx[i] - mx * mx, var_y = yy[i] - my * my, cov = xy[i] - mx * my;
    sum += ((2 * mx * my + kC1) * (2 * cov + kC2)) /
           ((mx * mx + my * my + kC1) * (var_x + var_y + kC2));
    ++count;
  });
  return count > 0 ? sum / static_cast<double>(count) : 1;
}

}  // namespace v3d
