#include "capture/segmentation/segmenter.h"

// Vectors of unknown length cannot be kept in arrays.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "capture/segmentation/quad_difference.cc"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "base/core/error.h"

#ifndef V3D_CAPTURE_QUAD_SEARCH
#define V3D_CAPTURE_QUAD_SEARCH
namespace v3d::segmentation {
namespace {

/// First samples of two rows of the image and of the background.
struct RowPair {
  const uint8_t* seen[2];
  const uint16_t* mean[2];
};

/// Parameters and buffers of the vectorised part. Buffers hold whole words of the mask plus a
/// pixel.
struct QuadSearch {
  const QuadTest& test;
  uint16_t gain;
  int sharpness_shift;
  size_t words;
  uint16_t* evidence;
  uint16_t* columns;
};

}  // namespace
}  // namespace v3d::segmentation
#endif

HWY_BEFORE_NAMESPACE();
namespace v3d::segmentation::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

constexpr size_t kWord = 64;

using Shorts = hn::CappedTag<uint16_t, 32>;
// For divisions: as many lanes as a vector holds floats.
using Floats = hn::CappedTag<float, 16>;
using Ints = hn::RebindToSigned<Floats>;
using FewShorts = hn::Rebind<uint16_t, Floats>;

/// One bit per lane.
template <class D>
HWY_INLINE uint64_t bits_of(D tag, hn::Mask<D> lanes) {
  uint8_t bytes[8] = {};
  hn::StoreMaskBits(tag, lanes, bytes);
  uint64_t bits = 0;
  std::memcpy(&bits, bytes, sizeof bits);
  return bits;
}

/// Loads the samples of as many pixels as there are lanes, one vector per channel.
template <int kChannels, class D>
HWY_INLINE void load(D shorts, const uint8_t* from, hn::Vec<D> (&to)[kChannels]) {
  const hn::Rebind<uint8_t, D> bytes;
  if constexpr (kChannels == 1) {
    to[0] = hn::PromoteTo(shorts, hn::LoadU(bytes, from));
  } else {
    hn::Vec<decltype(bytes)> a, b, c;
    hn::LoadInterleaved3(bytes, from, a, b, c);
    to[0] = hn::PromoteTo(shorts, a);
    to[1] = hn::PromoteTo(shorts, b);
    to[2] = hn::PromoteTo(shorts, c);
  }
}
template <int kChannels, class D>
HWY_INLINE void load(D shorts, const uint16_t* from, hn::Vec<D> (&to)[kChannels]) {
  if constexpr (kChannels == 1) {
    to[0] = hn::LoadU(shorts, from);
  } else {
    hn::LoadInterleaved3(shorts, from, to[0], to[1], to[2]);
  }
}

/// Expected values in 1/128 grey value, limited to the range of a sample.
template <class D>
HWY_INLINE hn::Vec<D> expectation(D shorts, hn::Vec<D> mean, uint16_t gain) {
  return hn::Min(hn::MulHigh(mean, hn::Set(shorts, gain)), hn::Set(shorts, kMaxExpected));
}

template <class V>
HWY_INLINE V difference(V a, V b) {
  return hn::Or(hn::SaturatedSub(a, b), hn::SaturatedSub(b, a));
}

/// Sum of the squared distances of each pixel's samples.
template <int kChannels>
HWY_INLINE hn::Vec<Shorts> evidence(const QuadSearch& search, const uint8_t* seen,
                                    const uint16_t* mean, const uint8_t* sharpness) {
  using V = hn::Vec<Shorts>;
  const Shorts shorts;
  V s[kChannels], m[kChannels], k[kChannels];
  load<kChannels>(shorts, seen, s);
  load<kChannels>(shorts, mean, m);
  load<kChannels>(shorts, sharpness, k);
  V sum = hn::Zero(shorts);
  for (int c = 0; c < kChannels; ++c) {
    const V expected = expectation(shorts, m[c], search.gain);
    const V grey = difference(hn::ShiftLeft<7>(s[c]), expected);
    const V scaled = hn::MulHigh(grey, hn::ShiftLeftSame(k[c], search.sharpness_shift));
    const V distance = hn::Min(scaled, hn::Set(shorts, search.test.max_distance));
    sum = hn::Add(sum, hn::Mul(distance, distance));
  }
  return sum;
}

template <int kChannels>
void measure_row(const QuadSearch& search, const uint8_t* seen, const uint16_t* mean,
                 const uint8_t* sharpness) {
  const Shorts shorts;
  for (size_t x = 0; x < search.words * kWord; x += hn::Lanes(shorts)) {
    const size_t i = x * kChannels;
    const auto here = evidence<kChannels>(search, seen + i, mean + i, sharpness + i);
    hn::StoreU(hn::Add(here, hn::LoadU(shorts, search.evidence + x)), shorts, search.columns + x);
    hn::StoreU(here, shorts, search.evidence + x);
  }
}

/// min(65535, a * scale / b).
HWY_INLINE hn::Vec<FewShorts> ratio(hn::Vec<FewShorts> a, hn::Vec<FewShorts> b, float scale) {
  const Floats floats;
  const auto as_floats = [&](auto v) { return hn::ConvertTo(floats, hn::PromoteTo(Ints(), v)); };
  const auto quotient = hn::Div(hn::Mul(as_floats(a), hn::Set(floats, scale)), as_floats(b));
  const auto limited = hn::Min(quotient, hn::Set(floats, 65535.0F));
  return hn::DemoteTo(FewShorts(), hn::ConvertTo(Ints(), limited));
}

/// Bits of the quads from pixel x on that are background in another light.
template <int kChannels>
HWY_INLINE uint64_t relit(const QuadSearch& search, const LightTest& test, const RowPair& rows,
                          size_t x) {
  using V = hn::Vec<FewShorts>;
  const FewShorts shorts;
  V seen[4][kChannels], expected[4][kChannels];
  for (size_t n = 0; n < 4; ++n) {
    const size_t i = (x + n % 2) * kChannels;
    load<kChannels>(shorts, rows.seen[n / 2] + i, seen[n]);
    load<kChannels>(shorts, rows.mean[n / 2] + i, expected[n]);
    for (V& e : expected[n]) e = expectation(shorts, e, search.gain);
  }
  // Sums over the quad: grey values seen, and a quarter of those expected in 1/32 grey value.
  V seen_sum = hn::Zero(shorts);
  V expected_sum = hn::Zero(shorts);
  for (int c = 0; c < kChannels; ++c) {
    const V upper = hn::AverageRound(expected[0][c], expected[1][c]);
    const V lower = hn::AverageRound(expected[2][c], expected[3][c]);
    expected_sum = hn::Add(expected_sum, hn::ShiftRight<2>(hn::AverageRound(upper, lower)));
    for (const auto& pixel : seen) seen_sum = hn::Add(seen_sum, pixel[c]);
  }
  const V min_expected = hn::Set(shorts, 32 * kChannels);
  const V factor = ratio(seen_sum, hn::Max(expected_sum, min_expected), 32768.0F * 32 / 4);
  const V limited =
      hn::Min(hn::Max(factor, hn::Set(shorts, test.min_factor)), hn::Set(shorts, test.max_factor));
  const V part = hn::MulHigh(hn::ShiftLeft<4>(seen_sum), hn::Set(shorts, test.allowed_part));
  const V allowed = hn::Add(hn::Set(shorts, test.allowed), part);
  V unexplained = hn::Zero(shorts);
  for (size_t n = 0; n < 4; ++n) {
    for (int c = 0; c < kChannels; ++c) {
      const V left = difference(hn::ShiftLeft<6>(seen[n][c]), hn::MulHigh(expected[n][c], factor));
      unexplained = hn::Or(unexplained, hn::SaturatedSub(left, allowed));
    }
  }
  return bits_of(shorts, hn::And(hn::Eq(limited, factor), hn::Eq(unexplained, hn::Zero(shorts))));
}

/// Clears the bits of quads that are background in another light. `differs` holds one bit per lane
/// of Shorts.
template <int kChannels>
HWY_INLINE uint64_t clear_relit(const QuadSearch& search, const LightTest& test,
                                const RowPair& rows, size_t x, uint64_t differs) {
  const size_t lanes = hn::Lanes(FewShorts());
  const uint64_t one_register = (uint64_t{1} << lanes) - 1;
  for (size_t n = 0; n < hn::Lanes(Shorts()); n += lanes) {
    if ((differs & one_register << n) == 0) continue;
    differs &= ~(relit<kChannels>(search, test, rows, x + n) << n);
  }
  return differs;
}

/// Flags the quads between the last two measured rows. keyed: bits of the quads with the colour of
/// the chroma key, or null.
template <int kChannels>
void flag_row(const QuadSearch& search, const RowPair& rows, const uint64_t* keyed,
              uint64_t* differs) {
  const Shorts shorts;
  const size_t lanes = hn::Lanes(shorts);
  const auto limit = hn::Set(shorts, search.test.limit);
  for (size_t w = 0; w < search.words; ++w) {
    uint64_t word = 0;
    for (size_t n = 0; n < kWord; n += lanes) {
      const uint16_t* column = search.columns + w * kWord + n;
      const auto sum = hn::Add(hn::LoadU(shorts, column), hn::LoadU(shorts, column + 1));
      uint64_t bits = bits_of(shorts, hn::Gt(sum, limit));
      if (bits != 0 && search.test.ignores_shadows) {
        bits = clear_relit<kChannels>(search, search.test.shadow, rows, w * kWord + n, bits);
      }
      if (const uint64_t asked = keyed ? bits & keyed[w] >> n : 0; asked != 0) {
        bits &=
            ~asked | clear_relit<kChannels>(search, search.test.key, rows, w * kWord + n, asked);
      }
      word |= bits << n;
    }
    differs[w] = word;
  }
}

void measure_any_row(const QuadSearch& search, int channels, const uint8_t* seen,
                     const uint16_t* mean, const uint8_t* sharpness) {
  const auto measure = channels == 3 ? measure_row<3> : measure_row<1>;
  measure(search, seen, mean, sharpness);
}

void flag_any_row(const QuadSearch& search, int channels, const RowPair& rows,
                  const uint64_t* keyed, uint64_t* differs) {
  const auto flag = channels == 3 ? flag_row<3> : flag_row<1>;
  flag(search, rows, keyed, differs);
}

}  // namespace
}  // namespace v3d::segmentation::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace v3d::segmentation {
namespace {

HWY_EXPORT(measure_any_row);
HWY_EXPORT(flag_any_row);

constexpr float kMaxEvidence = 60000;     ///< maximum limit of a quad; limited distances exceed it
constexpr uint16_t kMaxDistance = 127;    ///< four squares fit 16 bits
constexpr uint16_t kMaxDistanceRgb = 73;  ///< twelve squares fit 16 bits
constexpr float kLightNoise = 2.5F;       ///< noise of a relit sample, in noise floors

/// The sum of `freedom` squared normal deviates that is as improbable as one deviate of `level`
/// (Wilson and Hilferty's cube root).
float chi_square(float freedom, float level) {
  const float v = 2 / (9 * freedom);
  const float root = 1 - v + level * std::sqrt(v);
  return freedom * root * root * root;
}

uint16_t to_fixed(float value, float scale) {
  return static_cast<uint16_t>(std::lround(std::clamp(value * scale, 0.0F, 65535.0F)));
}

}  // namespace

LightTest::LightTest(float lowest, float highest, float chroma, int channels, float noise_floor)
    : min_factor(to_fixed(lowest, 32768)),
      max_factor(to_fixed(highest, 32768)),
      allowed(to_fixed(kLightNoise * noise_floor, 64)),
      allowed_part(to_fixed(chroma / static_cast<float>(channels), 65536)) {}

QuadTest::QuadTest(const BackgroundTable& background, const SegmentOptions& options)
    : max_distance(background.channels == 3 ? kMaxDistanceRgb : kMaxDistance),
      ignores_shadows(background.format != PixelFormat::kMono8),
      shadow(options.shadow_min, 1 + (1 - options.shadow_min) / 4, options.shadow_chroma,
             background.channels, options.noise_floor),
      key(options.key_min, options.key_max, options.key_chroma, background.channels,
          options.noise_floor) {
  const float steps = background.steps_per_spread;
  const float improbable =
      chi_square(static_cast<float>(4 * background.channels), options.threshold);
  limit = static_cast<uint16_t>(std::min(improbable * steps * steps, kMaxEvidence));
}

DifferingQuads::DifferingQuads(const BackgroundTable& background) : quads_(background.size) {
  const size_t pixels = static_cast<size_t>(quads_.words_per_row() + 1) * 64;
  evidence_.resize(pixels);
  columns_.resize(pixels);
  for (auto& tail : tails_) tail.resize(pixels * background.channels);
}

const Mask& DifferingQuads::find(ImageView image, const BackgroundTable& background,
                                 const QuadTest& test, uint32_t gain) {
  V3D_CHECK(image.size == background.size && image.format == background.format);
  V3D_CHECK(image.size.width >= 2 && image.size.height >= 2);
  const int channels = background.channels;
  const size_t samples = static_cast<size_t>(image.size.width) * channels;
  const QuadSearch search{test,
                          static_cast<uint16_t>(gain),
                          background.sharpness_shift,
                          static_cast<size_t>(quads_.words_per_row()),
                          evidence_.data(),
                          columns_.data()};
  const size_t reach = (search.words * 64 + 1) * channels;
  const int last = image.size.width - 1;
  const bool has_key = background.keyed.size() == background.size;
  RowPair rows{};
  for (int y = 0; y < image.size.height; ++y) {
    const size_t first = static_cast<size_t>(y) * samples;
    rows = {{rows.seen[1], image.row(y)}, {rows.mean[1], background.mean.data() + first}};
    if (first + reach > image.bytes.size()) {
      std::copy_n(image.row(y), samples, tails_[y % 2].begin());
      rows.seen[1] = tails_[y % 2].data();
    }
    HWY_DYNAMIC_DISPATCH(measure_any_row)
    (search, channels, rows.seen[1], rows.mean[1], background.sharpness.data() + first);
    if (y == 0) continue;
    const auto differs = quads_.row(y - 1);
    HWY_DYNAMIC_DISPATCH(flag_any_row)
    (search, channels, rows, has_key ? background.keyed.row(y - 1).data() : nullptr,
     differs.data());
    differs[last / 64] |= uint64_t{1} << last % 64;
  }
  return quads_;
}

}  // namespace v3d::segmentation
#endif
