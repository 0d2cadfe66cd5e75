#include "capture/segmentation/brightness.h"

#include <algorithm>
#include <array>

namespace v3d {
namespace {

constexpr double kEnough = 3000;    ///< samples to look at; more make the ratio no better
constexpr int kDarkest = 24;        ///< grey values; darker samples say little about a ratio
constexpr int kBrightest = 250;     ///< and those at the end of the scale nothing
constexpr uint32_t kBins = 1024;    ///< of ratios from 0 to 2
constexpr uint32_t kAgreeing = 32;  ///< bins that count as one ratio: 6 %
constexpr uint32_t kFewest = 64;    ///< samples; fewer are no majority
constexpr uint32_t kLowest = kUnitGain / 2;
constexpr uint32_t kHighest = kUnitGain * 19 / 10;

/// Samples lie closer in x, because that costs no more memory. Neither step is a multiple of 2 or
/// 3, so that every colour of a Bayer and of an RGB image is met.
constexpr int kStepX = 7;
int step_y(ImageView image) {
  const auto samples = static_cast<double>(byte_count(image.size, image.format));
  const int wanted = static_cast<int>(samples / (kStepX * kEnough));
  return std::max(1, (wanted + 3) / 6) * 6 + 1;
}

/// Calls f(seen, expected) for the subset of samples that tell something.
template <class F>
void for_each_sample(ImageView image, std::span<const uint16_t> mean, F f) {
  const int samples = image.size.width * bytes_per_pixel(image.format);
  const int step = step_y(image);
  for (int y = 0; y < image.size.height; y += step) {
    const uint8_t* row = image.row(y);
    const uint16_t* expected = mean.data() + static_cast<size_t>(y) * samples;
    for (int x = 0; x < samples; x += kStepX) {
      const bool tells =
          expected[x] >= kDarkest * 256 && expected[x] <= kBrightest * 256 && row[x] <= kBrightest;
      if (tells) f(uint32_t{row[x]}, uint32_t{expected[x]});
    }
  }
}

/// The first of the kAgreeing neighbouring bins that hold most samples.
uint32_t fullest_window(const std::array<uint32_t, kBins>& histogram) {
  uint32_t sum = 0;
  uint32_t most = 0;
  uint32_t best = 0;
  for (uint32_t bin = 0; bin < kBins; ++bin) {
    sum += histogram[bin];
    if (bin >= kAgreeing) sum -= histogram[bin - kAgreeing];
    if (sum > most) {
      most = sum;
      best = bin;
    }
  }
  return best >= kAgreeing - 1 ? best - (kAgreeing - 1) : 0;
}

}  // namespace

uint32_t brightness_ratio(ImageView image, std::span<const uint16_t> mean) {
  constexpr uint32_t kScale = 256 * (kBins / 2);  // of seen / expected, to bins
  std::array<uint32_t, kBins> histogram{};
  uint32_t total = 0;
  for_each_sample(image, mean, [&](uint32_t seen, uint32_t expected) {
    ++histogram[std::min(seen * kScale / expected, kBins - 1)];
    ++total;
  });
  if (total < kFewest) return kUnitGain;
  const uint32_t first = fullest_window(histogram);
  uint64_t seen_sum = 0;
  uint64_t expected_sum = 0;
  for_each_sample(image, mean, [&](uint32_t seen, uint32_t expected) {
    const uint32_t scaled = seen * kScale;
    const bool agrees = scaled >= first * expected && scaled < (first + kAgreeing) * expected;
    seen_sum += agrees ? seen : 0;
    expected_sum += agrees ? expected : 0;
  });
  if (expected_sum == 0) return kUnitGain;
  const uint64_t ratio = seen_sum * 256 * kUnitGain / expected_sum;
  return std::clamp(static_cast<uint32_t>(ratio), kLowest, kHighest);
}

}  // namespace v3d
