#include "capture/segmentation/image_measures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <span>
#include <vector>

namespace v3d::segmentation {
namespace {

constexpr double kTargetSamples = 3000;  ///< samples; more do not improve the ratio
constexpr int kMinGrey = 24;             ///< grey values; ratios of darker samples are imprecise
constexpr int kMaxGrey = 250;            ///< grey values; brighter samples may be saturated
constexpr uint32_t kBins = 1024;         ///< for ratios from 0 to 2
constexpr uint32_t kWindowBins = 32;     ///< bins that count as one ratio: 6 %
constexpr uint32_t kMinSamples = 64;     ///< samples; fewer give no reliable ratio
constexpr uint32_t kMinRatio = kUnitGain / 2;
constexpr uint32_t kMaxRatio = kUnitGain * 19 / 10;

/// Sampling step, in samples. It is smaller in x, because that reads no more memory. Neither step
/// is a multiple of 2 or 3, so that all colours of Bayer and RGB images are sampled.
constexpr int kStepX = 7;
int step_y(ImageView image) {
  const auto samples = static_cast<double>(byte_count(image.size, image.format));
  const int wanted = static_cast<int>(samples / (kStepX * kTargetSamples));
  return std::max(1, (wanted + 3) / 6) * 6 + 1;
}

/// Calls f(seen, expected) for a regular subset of the samples, without dark and saturated ones.
template <class F>
void for_each_sample(ImageView image, std::span<const uint16_t> mean, F f) {
  const int samples = image.size.width * bytes_per_pixel(image.format);
  const int step = step_y(image);
  for (int y = 0; y < image.size.height; y += step) {
    const uint8_t* row = image.row(y);
    const uint16_t* expected = mean.data() + static_cast<size_t>(y) * samples;
    for (int x = 0; x < samples; x += kStepX) {
      const bool is_usable =
          expected[x] >= kMinGrey * 256 && expected[x] <= kMaxGrey * 256 && row[x] <= kMaxGrey;
      if (is_usable) f(uint32_t{row[x]}, uint32_t{expected[x]});
    }
  }
}

/// First bin of the window of kWindowBins bins that holds the most samples.
uint32_t fullest_window(const std::array<uint32_t, kBins>& histogram) {
  uint32_t sum = 0;
  uint32_t max_sum = 0;
  uint32_t best = 0;
  for (uint32_t bin = 0; bin < kBins; ++bin) {
    sum += histogram[bin];
    if (bin >= kWindowBins) sum -= histogram[bin - kWindowBins];
    if (sum > max_sum) {
      max_sum = sum;
      best = bin;
    }
  }
  return best >= kWindowBins - 1 ? best - (kWindowBins - 1) : 0;
}

}  // namespace

uint32_t brightness_ratio(ImageView image, std::span<const uint16_t> mean) {
  constexpr uint32_t kScale = 256 * (kBins / 2);  // bins per seen / expected
  std::array<uint32_t, kBins> histogram{};
  uint32_t total = 0;
  for_each_sample(image, mean, [&](uint32_t seen, uint32_t expected) {
    ++histogram[std::min(seen * kScale / expected, kBins - 1)];
    ++total;
  });
  if (total < kMinSamples) return kUnitGain;
  const uint32_t first = fullest_window(histogram);
  uint64_t seen_sum = 0;
  uint64_t expected_sum = 0;
  for_each_sample(image, mean, [&](uint32_t seen, uint32_t expected) {
    const uint32_t scaled = seen * kScale;
    const bool agrees = scaled >= first * expected && scaled < (first + kWindowBins) * expected;
    seen_sum += agrees ? seen : 0;
    expected_sum += agrees ? expected : 0;
  });
  if (expected_sum == 0) return kUnitGain;
  const uint64_t ratio = seen_sum * 256 * kUnitGain / expected_sum;
  return std::clamp(static_cast<uint32_t>(ratio), kMinRatio, kMaxRatio);
}

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

double PictureStatistics::add(ImageView picture) {
  if (pictures_ == 0) {
    size_ = picture.size;
    format_ = picture.format;
    quads_.assign(static_cast<size_t>(half_of(size_).pixels()), 0);
  }
  if (picture.size != size_ || picture.format != format_) return 0;
  ++pictures_;
  const int64_t before = sum_;
  for (const uint8_t sample : picture.bytes) {
    clipped_ += sample >= kClipped;
    dark_ += sample <= kDark;
    sum_ += sample;
  }
  add_quads(picture.bytes, size_, bytes_per_pixel(format_), quads_);
  return static_cast<double>(sum_ - before) / static_cast<double>(picture.bytes.size());
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

namespace {

constexpr size_t kMinPictures = 8;
constexpr double kMinMeanGrey = 2;
constexpr double kFalseAlarms = 1e-3;
/// Steps of the frequency within the resolution of the series: fine enough for the amplitude.
constexpr int kStepsPerBin = 16;
constexpr double kMainsFlickerHz[] = {100, 120};

/// Sums of the normal equations of y = a cos + b sin + c.
struct Fit {
  double amplitude = 0;
  double explained = 0;  ///< share of the variance, 0 to 1
};

/// `y`: brightness minus its mean.
Fit fit_sinusoid(std::span<const double> t, std::span<const double> y, double hz) {
  double c = 0, s = 0, cc = 0, ss = 0, cs = 0, yc = 0, ys = 0, yy = 0;
  for (size_t i = 0; i < t.size(); ++i) {
    const double angle = 2 * std::numbers::pi * hz * t[i];
    const double cosine = std::cos(angle);
    const double sine = std::sin(angle);
    c += cosine;
    s += sine;
    cc += cosine * cosine;
    ss += sine * sine;
    cs += cosine * sine;
    yc += y[i] * cosine;
    ys += y[i] * sine;
    yy += y[i] * y[i];
  }
  // The constant is eliminated; the sum of y is 0.
  const auto n = static_cast<double>(t.size());
  cc -= c * c / n;
  ss -= s * s / n;
  cs -= c * s / n;
  const double determinant = cc * ss - cs * cs;
  if (yy <= 0) return {};
  double a = 0;
  double b = 0;
  if (determinant > 1e-9 * n * n) {
    a = (yc * ss - ys * cs) / determinant;
    b = (ys * cc - yc * cs) / determinant;
  } else if (cc > 0) {  // half of the pulse rate: the sine is 0 at every pulse
    a = yc / cc;
  }
  return {std::hypot(a, b), (a * yc + b * ys) / yy};
}

}  // namespace

std::optional<Flicker> measure_flicker(std::span<const PulseBrightness> series, double rate_hz) {
  if (series.size() < kMinPictures) return {};
  series = series.last(std::min(series.size(), kMaxFlickerPictures));
  double mean = 0;
  int64_t first = series.front().pulse;
  int64_t last = first;
  for (const PulseBrightness& picture : series) {
    mean += picture.grey / static_cast<double>(series.size());
    first = std::min(first, picture.pulse);
    last = std::max(last, picture.pulse);
  }
  if (mean < kMinMeanGrey || last == first) return {};
  std::vector<double> t;
  std::vector<double> y;
  for (const PulseBrightness& picture : series) {
    t.push_back(static_cast<double>(picture.pulse - first) / rate_hz);
    y.push_back(picture.grey - mean);
  }
  const double bin_hz = rate_hz / static_cast<double>(last - first + 1);
  Fit best;
  double best_hz = 0;
  const int steps = static_cast<int>(std::ceil(kStepsPerBin * rate_hz / 2 / bin_hz));
  for (int step = kStepsPerBin / 2; step <= steps; ++step) {
    const double hz = std::min(step * bin_hz / kStepsPerBin, rate_hz / 2);
    const Fit fit = fit_sinusoid(t, y, hz);
    if (fit.explained > best.explained) {
      best = fit;
      best_hz = hz;
    }
  }
  // With noise alone, the explained share of one frequency exceeds z with probability
  // (1 - z)^((n - 3) / 2). There are about n / 2 independent frequencies.
  const auto n = static_cast<double>(series.size());
  const double limit = 1 - std::pow(2 * kFalseAlarms / n, 2 / (n - 3));
  if (best.explained < limit) return {};
  return Flicker{best.amplitude / mean, best_hz};
}

std::optional<double> rate_without_flicker(double beat_hz, double rate_hz, double tolerance_hz) {
  std::optional<double> best;
  for (const double lamp_hz : kMainsFlickerHz) {
    const double periods = std::round(lamp_hz / rate_hz);
    const double beat = std::abs(lamp_hz - periods * rate_hz);
    if (periods < 1 || std::abs(beat - beat_hz) > tolerance_hz) continue;
    const double rate = lamp_hz / periods;
    if (!best || std::abs(rate - rate_hz) < std::abs(*best - rate_hz)) best = rate;
  }
  return best;
}

}  // namespace v3d::segmentation
