#include "capture/segmenter.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <utility>

#include "capture/brightness.h"
#include "capture/mask_cleanup.h"
#include "capture/moved_background.h"
#include "capture/vectorised.h"

namespace v3d {
namespace {

// Fixed-point scales. They are chosen so that a row is worked through in 16-bit lanes:
// grey values to 1/128, distances to 1/8 spread, squared distances of a quad in 16 bits.
constexpr float kSharpnessScale = 4096;  ///< distance = grey difference / 128 * sharpness / 65536
constexpr float kEvidenceScale = 64;     ///< (1/8 spread)^2
constexpr float kMostEvidence = 60000;   ///< of a quad; what lies far away must still exceed it
constexpr uint16_t kFar = 127;           ///< 15.9 spreads; four squares fit 16 bits
constexpr uint16_t kFarRgb = 73;         ///< 9.1 spreads; twelve squares fit 16 bits
constexpr float kLeastSpread = 0.5F;     ///< grey values
constexpr float kMostSpread = 64;
constexpr float kSaturated = 248;  ///< a lamp: how bright it is cannot be seen, so it seems not to
constexpr float kSaturatedSpread = 10;  ///< flicker with the light it gives
constexpr float kShadowNoise = 2.5F;    ///< noise floors that noise may add to a shadow's sample

/// The sum of `freedom` squared normal deviates that is as improbable as one deviate of `level`
/// (Wilson and Hilferty's cube root).
float chi_square(float freedom, float level) {
  const float v = 2 / (9 * freedom);
  const float root = 1 - v + level * std::sqrt(v);
  return freedom * root * root * root;
}

/// Grey values by which the background changes from one pixel to the next, at its steepest: half
/// the difference to the neighbours of the same colour, which in a Bayer image are two pixels away.
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

/// Of each sample: what the model expects of it in this image's brightness, and its squared
/// distance from that.
V3D_VECTORISED void measure(const uint8_t* samples, const uint16_t* mean, const uint16_t* sharpness,
                            uint32_t gain, uint16_t far, int n, uint16_t* expected,
                            uint16_t* squares) {
  for (int i = 0; i < n; ++i) {
    const auto e = static_cast<uint16_t>((mean[i] * gain) >> 16);
    const auto s = static_cast<uint16_t>(samples[i] << 7);
    const auto difference = static_cast<uint16_t>(std::max(e, s) - std::min(e, s));
    const auto distance = static_cast<uint16_t>((uint32_t{difference} * sharpness[i]) >> 16);
    const uint16_t limited = std::min(distance, far);
    expected[i] = e;
    squares[i] = static_cast<uint16_t>(limited * limited);
  }
}

V3D_VECTORISED void flag_quads(const uint16_t* upper, const uint16_t* lower, uint16_t limit, int n,
                               uint8_t* flags) {
  for (int x = 0; x < n; ++x) {
    const auto sum = static_cast<uint16_t>(upper[x] + upper[x + 1] + lower[x] + lower[x + 1]);
    flags[x] = sum > limit ? 1 : 0;
  }
}

/// The samples of two by two pixels, kSamples in a row: a number that is known when it is compiled,
/// because this is asked of every pixel of the performer.
template <int kSamples>
struct Quad {
  const uint8_t* seen[2];       ///< grey values of the upper and the lower row
  const uint16_t* expected[2];  ///< 1/128 grey values
};

/// One factor explains all samples: it leaves of each less than noise and the allowed change of
/// colour.
template <int kSamples>
bool is_shadow(const Quad<kSamples>& quad, const SegmentOptions& options) {
  int seen = 0;
  int expected = 0;
  for (int row = 0; row < 2; ++row) {
    for (int i = 0; i < kSamples; ++i) {
      seen += quad.seen[row][i];
      expected += quad.expected[row][i];
    }
  }
  const float factor =
      static_cast<float>(seen) / std::max(static_cast<float>(expected) / 128, 1.0F);
  const float highlight_max = 1 + (1 - options.shadow_min) / 4;
  if (factor < options.shadow_min || factor > highlight_max) return false;
  const float mean = static_cast<float>(seen) / static_cast<float>(2 * kSamples);
  const float allowed = kShadowNoise * options.noise_floor + options.shadow_chroma * mean;
  bool explained = true;
  for (int row = 0; row < 2; ++row) {
    for (int i = 0; i < kSamples; ++i) {
      const float shaded = factor * (static_cast<float>(quad.expected[row][i]) / 128);
      explained &= std::abs(static_cast<float>(quad.seen[row][i]) - shaded) <= allowed;
    }
  }
  return explained;
}

/// Takes the shadows out of `differs`, the flags of a row of quads.
template <int kChannels>
void spare_shadows(const uint8_t* const seen[2], const uint16_t* const expected[2],
                   const SegmentOptions& options, std::span<uint64_t> differs) {
  for (size_t w = 0; w < differs.size(); ++w) {
    for (uint64_t rest = differs[w]; rest != 0; rest &= rest - 1) {
      const int bit = std::countr_zero(rest);
      const size_t first = (w * 64 + static_cast<size_t>(bit)) * kChannels;
      const Quad<2 * kChannels> quad{{seen[0] + first, seen[1] + first},
                                     {expected[0] + first, expected[1] + first}};
      if (is_shadow(quad, options)) differs[w] &= ~(uint64_t{1} << bit);
    }
  }
}

/// 64 flags of 0 or 1 to the bits of a word. Multiplying gathers the lowest bits of eight bytes in
/// the top byte.
uint64_t pack(const uint8_t* flags) {
  uint64_t word = 0;
  for (int byte = 0; byte < 8; ++byte) {
    uint64_t eight;
    __builtin_memcpy(&eight, flags + 8 * byte, 8);
    word |= ((eight * 0x0102040810204080U) >> 56) << (8 * byte);
  }
  return word;
}
static_assert(std::endian::native == std::endian::little, "pack() counts on it");

/// Bits whose neighbour at x - 1 is set; beyond the left border counts as set.
uint64_t from_left(std::span<const uint64_t> row, size_t w) {
  return (row[w] << 1) | (w > 0 ? row[w - 1] >> 63 : 1);
}

}  // namespace

Segmenter::Segmenter(BackgroundModel model, SegmentOptions options)
    : model_(std::move(model)), options_(options), channels_(bytes_per_pixel(model_.format)) {
  const size_t samples = byte_count(model_.size, model_.format);
  assert(model_.mean.size() == samples && model_.spread.size() == samples);
  mean_.resize(samples);
  sharpness_.resize(samples);
  size_t i = 0;
  for (int y = 0; y < model_.size.height; ++y) {
    for (int x = 0; x < model_.size.width; ++x) {
      for (int c = 0; c < channels_; ++c, ++i) {
        mean_[i] =
            static_cast<uint16_t>(std::lround(std::clamp(model_.mean[i], 0.0F, 255.0F) * 256));
        const float floor = model_.mean[i] > kSaturated ? kSaturatedSpread : kLeastSpread;
        const float noise = std::max({model_.spread[i], options_.noise_floor, floor});
        const float moved = options_.shake * slope(model_, channels_, x, y, c);
        const float spread = std::min(std::sqrt(noise * noise + moved * moved), kMostSpread);
        sharpness_[i] = static_cast<uint16_t>(std::lround(kSharpnessScale / spread));
      }
    }
  }
  const float far = chi_square(static_cast<float>(4 * channels_), options_.threshold);
  quad_limit_ = static_cast<uint16_t>(std::min(far * kEvidenceScale, kMostEvidence));
  const auto width = static_cast<size_t>(model_.size.width);
  for (Row& row : rows_) {
    row.expected.resize(width * channels_);
    row.evidence.resize(width);
  }
  squares_.resize(channels_ * width);
  quads_ = Mask(model_.size);
  flags_.resize(static_cast<size_t>(quads_.words_per_row()) * 64);
}

void Segmenter::measure_row(ImageView image, int y, uint32_t gain, Row& row) {
  const int width = model_.size.width;
  const size_t first = static_cast<size_t>(y) * width * channels_;
  const bool rgb = channels_ == 3;
  measure(image.row(y), &mean_[first], &sharpness_[first], gain, rgb ? kFarRgb : kFar,
          width * channels_, row.expected.data(), rgb ? squares_.data() : row.evidence.data());
  if (!rgb) return;
  for (int x = 0; x < width; ++x) {
    const uint16_t* s = &squares_[3 * x];
    row.evidence[x] = static_cast<uint16_t>(s[0] + s[1] + s[2]);
  }
}

void Segmenter::find_quads(const Row& upper, const Row& lower, std::span<uint64_t> differs) {
  flag_quads(upper.evidence.data(), lower.evidence.data(), quad_limit_, model_.size.width - 1,
             flags_.data());
  for (size_t w = 0; w < differs.size(); ++w) differs[w] = pack(&flags_[64 * w]);
}

Mask Segmenter::segment(ImageView image) {
  assert(image.size == model_.size && image.format == model_.format);
  const int width = model_.size.width;
  const int height = model_.size.height;
  Mask mask(model_.size);
  if (width < 2 || height < 2) return mask;
  const uint32_t gain = brightness_ratio(image, mean_);
  const int last = width - 1;  // there is no quad at the last column, nor at the last row
  measure_row(image, 0, gain, rows_[0]);
  for (int y = 0; y + 1 < height; ++y) {
    const Row& upper = rows_[y % 2];
    Row& lower = rows_[(y + 1) % 2];
    measure_row(image, y + 1, gain, lower);
    const auto differs = quads_.row(y);
    find_quads(upper, lower, differs);
    const uint8_t* const seen[] = {image.row(y), image.row(y + 1)};
    const uint16_t* const expected[] = {upper.expected.data(), lower.expected.data()};
    if (image.format == PixelFormat::kRGB8) {
      spare_shadows<3>(seen, expected, options_, differs);
    } else if (image.format != PixelFormat::kMono8) {
      spare_shadows<1>(seen, expected, options_, differs);
    }
    differs[last / 64] |= uint64_t{1} << last % 64;
  }
  combine_quads(mask);
  take_majority(mask);
  drop_small_pieces(mask, options_.min_area);
  drop_moved_background(mask, image, {mean_, sharpness_, gain, quad_limit_}, options_.moved);
  fill_small_holes(mask, options_.max_hole);
  return mask;
}

void Segmenter::combine_quads(Mask& mask) const {
  const int height = model_.size.height;
  const int tail = model_.size.width % 64;
  const uint64_t last_word = tail ? (uint64_t{1} << tail) - 1 : ~uint64_t{0};
  for (int y = 0; y < height; ++y) {
    const auto above = quads_.row(std::max(y - 1, 0));
    const auto below = quads_.row(std::min(y, height - 2));
    const auto row = mask.row(y);
    for (size_t w = 0; w < row.size(); ++w) {
      row[w] = above[w] & from_left(above, w) & below[w] & from_left(below, w);
    }
    row[row.size() - 1] &= last_word;
  }
}

}  // namespace v3d
