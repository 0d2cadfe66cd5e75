#include "capture/segmentation/background_table.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/core/check.h"

namespace v3d {
namespace {

constexpr float kMinSpread = 0.5F;  ///< grey values
constexpr float kMaxSpread = 64;
/// Above this grey value a sample is saturated, such as a lamp. Its measured spread is too small,
/// because flicker is not visible in it; kSaturatedSpread replaces it.
constexpr float kSaturated = 248;
constexpr float kSaturatedSpread = 10;
constexpr float kMaxSharpness = 255;
constexpr float kMaxSteps = 8;  ///< per spread: the squared distances of a quad fit 16 spreads

/// Maximum slope of the background, in grey values per pixel. In a Bayer image it is half the
/// difference to the neighbours of the same colour, which are two pixels away.
float slope(const BackgroundModel& model, int channels, int x, int y, int channel) {
  const int step = is_bayer(model.format) ? 2 : 1;
  const auto at = [&](int u, int v) {
    u = std::clamp(u, x % step, model.size.width - 1);
    v = std::clamp(v, y % step, model.size.height - 1);
    if ((u - x) % step) u -= 1;
    if ((v - y) % step) v -= 1;
    return model.mean[(static_cast<size_t>(v) * model.size.width + u) * channels + channel];
  };
  const float here = at(x, y);
  float steepest = 0;
  for (const float there : {at(x - step, y), at(x + step, y), at(x, y - step), at(x, y + step)}) {
    steepest = std::max(steepest, std::abs(there - here));
  }
  return steepest / static_cast<float>(step);
}

/// Minimum difference between the key's channel and the others, in grey values, and minimum ratio.
constexpr float kMinKeyDifference = 16;
constexpr float kMinKeyRatio = 1.25F;

/// Mean colour (red, green, blue) of the quad at (x, y).
std::array<float, 3> colour_of_quad(const BackgroundModel& model, int x, int y) {
  std::array<float, 3> sum{};
  std::array<int, 3> count{};
  for (const int v : {y, y + 1}) {
    for (const int u : {x, x + 1}) {
      const size_t pixel = static_cast<size_t>(v) * model.size.width + u;
      if (is_bayer(model.format)) {
        const int channel = bayer_channel(model.format, u, v);
        sum[channel] += model.mean[pixel];
        ++count[channel];
        continue;
      }
      for (int channel = 0; channel < 3; ++channel) {
        sum[channel] += model.mean[3 * pixel + channel];
        ++count[channel];
      }
    }
  }
  for (size_t channel = 0; channel < 3; ++channel)
    sum[channel] /= static_cast<float>(count[channel]);
  return sum;
}

bool has_colour_of(ChromaKey key, const std::array<float, 3>& colour) {
  const float own = colour[key == ChromaKey::kGreen ? 1 : 2];
  const float other = std::max(colour[0], colour[key == ChromaKey::kGreen ? 2 : 1]);
  return own - other >= kMinKeyDifference && own >= kMinKeyRatio * other;
}

Mask keyed_quads(const BackgroundModel& model) {
  if (model.key == ChromaKey::kNone || model.format == PixelFormat::kMono8) return {};
  Mask keyed(model.size);
  for (int y = 0; y + 1 < model.size.height; ++y) {
    for (int x = 0; x + 1 < model.size.width; ++x) {
      if (has_colour_of(model.key, colour_of_quad(model, x, y))) keyed.set(x, y);
    }
  }
  return keyed;
}

}  // namespace

BackgroundTable::BackgroundTable(const BackgroundModel& model, const SegmentOptions& options)
    : size(model.size),
      format(model.format),
      channels(bytes_per_pixel(model.format)),
      keyed(keyed_quads(model)) {
  const size_t samples = byte_count(size, format);
  V3D_CHECK(model.mean.size() == samples && model.spread.size() == samples);
  mean.resize(samples + kReach);
  sharpness.resize(samples + kReach);
  const float min_spread = std::clamp(options.noise_floor, kMinSpread, kMaxSpread);
  const float scale = kMaxSharpness * min_spread;  // of 1 / spread; 512 make 1 step per spread
  sharpness_shift = static_cast<int>(std::floor(std::log2(512 * kMaxSteps / scale)));
  sharpness_shift = std::max(sharpness_shift, 0);
  steps_per_spread = std::ldexp(scale / 512, sharpness_shift);
  size_t i = 0;
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      for (int c = 0; c < channels; ++c, ++i) {
        const float grey = std::clamp(model.mean[i], 0.0F, 255.0F);
        mean[i] = static_cast<uint16_t>(std::lround(grey * 256));
        const float floor = model.mean[i] > kSaturated ? kSaturatedSpread : kMinSpread;
        const float noise = std::max({model.spread[i], min_spread, floor});
        const float moved = options.shake * slope(model, channels, x, y, c);
        const float spread = std::min(std::sqrt(noise * noise + moved * moved), kMaxSpread);
        sharpness[i] = static_cast<uint8_t>(std::lround(scale / spread));
      }
    }
  }
}

}  // namespace v3d
