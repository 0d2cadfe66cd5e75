#include "capture/segmentation/picture_quality.h"

#include <cstddef>
#include <span>

namespace v3d {
namespace {

constexpr uint8_t kClipped = 250;
constexpr uint8_t kDark = 5;

ImageSize half_of(ImageSize size) { return {size.width / 2, size.height / 2}; }

/// Adds the samples of every 2x2 pixels to a quad: an image at half size.
template <class Sample, class Sum>
void add_quads(std::span<const Sample> samples, ImageSize size, int channels,
               std::vector<Sum>& quads) {
  const ImageSize half = half_of(size);
  const auto row_length = static_cast<size_t>(size.width) * static_cast<size_t>(channels);
  for (int y = 0; y < half.height; ++y) {
    const Sample* upper = samples.data() + 2 * static_cast<size_t>(y) * row_length;
    const Sample* lower = upper + row_length;
    Sum* quad = quads.data() + static_cast<size_t>(y) * static_cast<size_t>(half.width);
    for (int x = 0; x < half.width; ++x, upper += 2 * channels, lower += 2 * channels) {
      for (int i = 0; i < 2 * channels; ++i)
        quad[x] += static_cast<Sum>(upper[i]) + static_cast<Sum>(lower[i]);
    }
  }
}

/// Variance of the Laplacian of the quads, divided by `per_grey`, in grey values squared.
template <class Sum>
double laplacian_variance(const std::vector<Sum>& quads, ImageSize half, double per_grey) {
  const auto width = static_cast<ptrdiff_t>(half.width);
  double sum = 0, squares = 0, count = 0;
  for (int y = 1; y + 1 < half.height; ++y) {
    const Sum* row = quads.data() + y * width;
    for (int x = 1; x + 1 < half.width; ++x) {
      const double neighbours = static_cast<double>(row[x - 1]) + static_cast<double>(row[x + 1]) +
                                static_cast<double>(row[x - width]) +
                                static_cast<double>(row[x + width]);
      const double laplacian = (neighbours - 4 * static_cast<double>(row[x])) / per_grey;
      sum += laplacian;
      squares += laplacian * laplacian;
      ++count;
    }
  }
  return count > 0 ? squares / count - (sum / count) * (sum / count) : 0;
}

}  // namespace

void PictureStatistics::add(ImageView picture) {
  if (pictures_ == 0) {
    size_ = picture.size;
    format_ = picture.format;
    quads_.assign(static_cast<size_t>(half_of(size_).pixels()), 0);
  }
  if (picture.size != size_ || picture.format != format_) return;
  ++pictures_;
  for (const uint8_t sample : picture.bytes) {
    clipped_ += sample >= kClipped;
    dark_ += sample <= kDark;
    sum_ += sample;
  }
  add_quads(picture.bytes, size_, bytes_per_pixel(format_), quads_);
}

PictureQuality PictureStatistics::result() const {
  if (pictures_ == 0) return {};
  const double samples =
      static_cast<double>(byte_count(size_, format_)) * static_cast<double>(pictures_);
  const double per_grey = 4.0 * bytes_per_pixel(format_) * static_cast<double>(pictures_);
  return {.clipped = static_cast<double>(clipped_) / samples,
          .dark = static_cast<double>(dark_) / samples,
          .mean_grey = static_cast<double>(sum_) / samples,
          .focus = laplacian_variance(quads_, half_of(size_), per_grey)};
}

double focus_of(const BackgroundModel& model) {
  const int channels = bytes_per_pixel(model.format);
  const ImageSize half = half_of(model.size);
  std::vector<float> quads(static_cast<size_t>(half.pixels()));
  add_quads(std::span<const float>(model.mean), model.size, channels, quads);
  return laplacian_variance(quads, half, 4.0 * channels);
}

}  // namespace v3d
